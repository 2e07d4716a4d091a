"use strict";
// tables are sorted by their column headings; words follow numbers, and what has no value is last
for (const table of document.querySelectorAll("table[data-sortable]")) {
  const body = table.tBodies[0];
  const headings = [...table.tHead.rows[0].cells];
  const order = new Intl.Collator("en", { numeric: true }).compare;
  const key = (row, column) => {
    const cell = row.cells[column];
    if (!("value" in cell.dataset)) return cell.textContent.trim();
    const value = cell.dataset.value;
    return value === "" ? null : value === "inf" ? Infinity : value === "-inf" ? -Infinity : Number(value);
  };
  headings.forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const up = heading.getAttribute("aria-sort") !== "ascending";
      headings.forEach((other) => other.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", up ? "ascending" : "descending");
      const rows = [...body.rows].map((row) => [key(row, column), row]);
      rows.sort(([a], [b]) => {
        if (a === null || b === null) return (a === null) - (b === null);
        if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;
        const found = typeof a === "string" ? order(a, b) : a < b ? -1 : a > b ? 1 : 0;
        return up ? found : -found;
      });
      body.append(...rows.map(([, row]) => row));
    });
  });
}
// on a small screen the contents fold away; paper shows everything
const contents = document.querySelector(".contents");
if (window.matchMedia("(max-width: 40rem)").matches) contents.open = false;
window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));

// Verdict in words, and the table of safety and energy.

import { tell } from "./scale.js";

export class Figures {
  constructor(table) {
    this.table = table;
    this.body = table.tBodies[0];
    this.now = [];
    this.pinned = null;
  }

  show(now) {
    this.now = now;
    this.draw();
  }

  pin(pinned) {
    this.pinned = pinned;
    this.draw();
  }

  draw() {
    this.table.classList.toggle("compares", this.pinned !== null);
    this.body.replaceChildren(...this.now.map((figure, i) => {
      const row = document.createElement("tr");
      const cell = (tag, text, name = "") => {
        const made = Object.assign(document.createElement(tag), { textContent: text, className: name });
        row.append(made);
        return made;
      };
      const written = (f) => (f ? `${tell(f.value)}${f.value === null ? "" : ` ${f.unit}`}` : "–");
      cell("th", figure.name).scope = "row";
      cell("td", written(figure));
      cell("td", written(this.pinned?.[i]), "pinned");
      cell("td", figure.vehicle ?? "");
      return row;
    }));
  }
}

export function sayVerdict(place, sentences) {
  place.replaceChildren(...sentences.map((text) => Object.assign(document.createElement("p"), { textContent: text })));
  place.classList.remove("old");
}

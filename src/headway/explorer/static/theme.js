// Colours from the style sheet, for what is drawn on canvases.

let known = null;
const dark = matchMedia("(prefers-color-scheme: dark)");

export function onTheme(redraw) {
  dark.addEventListener("change", () => {
    known = null;
    redraw();
  });
}

export function colours() {
  if (!known) {
    const style = getComputedStyle(document.documentElement);
    known = new Proxy({}, { get: (t, name) => (t[name] ??= style.getPropertyValue("--" + name).trim()) });
  }
  return known;
}

const mixed = new Map();

// The colour of follower n of count: from the head over the middle to the tail.
export function ofVehicle(n, count) {
  const c = colours();
  const share = count < 2 ? 0 : n / (count - 1);
  const key = `${c.head} ${share}`;
  if (!mixed.has(key)) {
    if (mixed.size > 2000) mixed.clear();
    const [a, b, t] = share < 0.5 ? [c.head, c.middle, 2 * share] : [c.middle, c.tail, 2 * share - 1];
    const parts = [1, 3, 5].map((i) => Math.round(parseInt(a.slice(i, i + 2), 16) * (1 - t) + parseInt(b.slice(i, i + 2), 16) * t));
    mixed.set(key, `rgb(${parts.join(" ")})`);
  }
  return mixed.get(key);
}

// Where a slider stands for a value, and how numbers are written. The server says which scale (controls.py).

export const STEPS = 1000;

export function toSlider(value, s) {
  const share = s.scale === "log"
    ? Math.log(value / s.low) / Math.log(s.high / s.low)
    : Math.pow(Math.max(0, (value - s.low) / (s.high - s.low)), 1 / s.p);
  return Math.round(STEPS * Math.min(1, Math.max(0, share)));
}

export function fromSlider(place, s, whole = false) {
  const share = place / STEPS;
  const value = s.scale === "log"
    ? s.low * Math.pow(s.high / s.low, share)
    : s.low + (s.high - s.low) * Math.pow(share, s.p);
  if (whole) return Math.round(value);
  if (s.step) return Number((Math.round(value / s.step) * s.step).toPrecision(10));
  if (place <= 0) return s.low;
  if (place >= STEPS) return s.high;
  return Number(value.toPrecision(4));
}

export function tell(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return String(Number(value.toPrecision(digits)));
}

// Round values from low to high, about `count` of them.
export function ticks(low, high, count) {
  const raw = (high - low) / Math.max(count, 1);
  const power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw) ?? 10 * power;
  const found = [], first = Math.ceil(low / step - 1e-9);
  // a range may be so narrow beside its values that a step does not change them: then it has no end
  for (let k = 0; k < 60 && (first + k) * step <= high + 1e-9 * step; k++) found.push(Number(((first + k) * step).toPrecision(10)));
  return found;
}

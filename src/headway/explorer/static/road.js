// The platoon driving: the samples of the run, drawn between them in time.

import { tell, ticks } from "./scale.js";
import { colours } from "./theme.js";

const CAR = 7; // least length of a car [px]

export class Road {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.fit();
  }

  fit() {
    const ratio = window.devicePixelRatio || 1;
    [this.width, this.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (this.run) this.draw(this.run, this.time);
  }

  draw(run, time) {
    this.run = run;
    this.time = time;
    const { pen, width, height } = this, c = colours();
    const { time: t, position, acceleration } = run.arrays;
    const [i, share] = between(t, time);
    const at = (row) => row[i] + share * (row[i + 1] - row[i]);
    const cars = position.map((row, n) => ({ x: at(row), a: at(acceleration[n]), length: run.lengths[n] }));
    const there = cars.filter((car) => Number.isFinite(car.x));
    // the view takes the longest the platoon has been, so that it does not breathe
    const head = there[0].x, span = run.span ??= longest(position);
    const scale = (width - 40) / span, px = (x) => width - 24 - (head - x) * scale;
    pen.clearRect(0, 0, width, height);
    const road = height - 22;
    pen.strokeStyle = c.line;
    pen.fillStyle = c.soft;
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(0, road + 1);
    pen.lineTo(width, road + 1);
    pen.stroke();
    for (const x of ticks(head - (width - 24) / scale, head, Math.max(2, width / 110))) {
      pen.fillRect(px(x), road, 1, 5);
      if (px(x) > 26 && px(x) < width - 26) pen.fillText(`${tell(x)} m`, px(x), height - 4);
    }
    cars.forEach((car, n) => {
      if (!Number.isFinite(car.x)) return;
      const long = Math.max(CAR, car.length * scale), strong = Math.min(1, Math.abs(car.a) / 1.5);
      const left = px(car.x) - long, top = road - 15;
      pen.fillStyle = n ? c.soft : c.ink;
      pen.beginPath();
      pen.roundRect(left, top, long, 12, 3);
      pen.fill();
      pen.globalAlpha = strong;
      pen.fillStyle = car.a < 0 ? c.slower : c.faster;
      pen.fill();
      pen.globalAlpha = 1;
    });
    run.collisions.forEach((when, n) => {
      if (when === null || when > time) return;
      const row = position[n - 1], x = Number.isFinite(at(row)) ? at(row) : head - span;
      pen.fillStyle = c.bad;
      pen.textAlign = "left";
      pen.fillText(`✕ vehicle ${n} collided at ${tell(when)} s`, Math.max(4, Math.min(width - 190, px(x) - 90)), 14);
    });
  }
}

function longest(position) {
  let most = 1;
  const lead = position[0];
  for (const row of position) for (let k = 0; k < row.length; k++) if (lead[k] - row[k] > most) most = lead[k] - row[k];
  return most * 1.02 + 6;
}

// The sample before `time` and how far it is to the next.
function between(t, time) {
  let low = 0, high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle; else high = middle;
  }
  return [low, Math.min(1, Math.max(0, (time - t[low]) / (t[low + 1] - t[low])))];
}

// A small chart on a canvas: lines over a linear or logarithmic axis, redrawn in a few milliseconds.

import { tell, ticks } from "./scale.js";
import { colours } from "./theme.js";

const LEFT = 44, RIGHT = 10, TOP = 8, BOTTOM = 26;

export class Chart {
  // options: x, y (what the axes are, in words), log (the x axis), least (a span of y that is always shown), onTime
  constructor(place, options) {
    this.options = options;
    this.canvas = place.appendChild(document.createElement("canvas"));
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", options.label);
    this.pen = this.canvas.getContext("2d");
    this.data = null;
    if (options.onTime) {
      this.now = place.appendChild(document.createElement("div"));
      this.now.className = "now";
      const go = (event) => { if (this.data) options.onTime(this.timeAt(event.offsetX)); };
      this.canvas.addEventListener("pointerdown", (event) => {
        this.canvas.setPointerCapture(event.pointerId);
        go(event);
      });
      this.canvas.addEventListener("pointermove", (event) => { if (event.buttons) go(event); });
    }
    new ResizeObserver(() => this.fit()).observe(place);
    this.fit();
  }

  fit() {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (w === this.width && h === this.height) return;
    const ratio = window.devicePixelRatio || 1;
    [this.width, this.height] = [w, h];
    this.canvas.width = Math.round(w * ratio);
    this.canvas.height = Math.round(h * ratio);
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.draw(this.data);
  }

  timeAt(px) {
    const [low, high] = this.range.x;
    return low + (high - low) * Math.min(1, Math.max(0, (px - LEFT) / (this.width - LEFT - RIGHT)));
  }

  showTime(time) {
    if (!this.range) return;
    const [low, high] = this.range.x;
    this.now.style.transform = `translateX(${LEFT + (this.width - LEFT - RIGHT) * (time - low) / (high - low)}px)`;
  }

  // data: lines [{x, y, colour, width?, dash?, alpha?, factor?}], marks? [x], level? (a horizontal line)
  draw(data) {
    this.data = data;
    if (!data || !data.lines.length || this.width < 80) return;
    const { pen, width, height } = this, c = colours();
    const range = this.range = this.extent(data);
    const flat = this.options.log ? Math.log : (v) => v;
    const [x0, x1] = range.x.map(flat), [y0, y1] = range.y;
    const kx = (width - LEFT - RIGHT) / (x1 - x0), ky = (height - TOP - BOTTOM) / (y1 - y0);
    const px = (x) => LEFT + (flat(x) - x0) * kx, py = (y) => height - BOTTOM - (y - y0) * ky;
    pen.clearRect(0, 0, width, height);
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1;
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    pen.strokeStyle = c.grid;
    pen.fillStyle = c.soft;
    pen.beginPath();
    for (const y of ticks(y0, y1, Math.max(3, height / 38))) {
      pen.moveTo(LEFT, Math.round(py(y)) + 0.5);
      pen.lineTo(width - RIGHT, Math.round(py(y)) + 0.5);
      pen.fillText(tell(y), LEFT - 6, py(y));
    }
    pen.textAlign = "center";
    const across = this.options.log ? decades(...range.x) : ticks(x0, x1, Math.max(2, width / 90));
    for (const x of across) {
      pen.moveTo(Math.round(px(x)) + 0.5, TOP);
      pen.lineTo(Math.round(px(x)) + 0.5, height - BOTTOM);
      pen.fillText(tell(x), px(x), height - BOTTOM + 9);
    }
    pen.stroke();
    pen.textAlign = "right";
    pen.fillText(this.options.x, width - RIGHT, height - 6);
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    pen.clip();
    if (data.level !== undefined) this.stroke({ colour: c.soft, dash: [2, 3] }, () => { pen.moveTo(LEFT, py(data.level)); pen.lineTo(width, py(data.level)); });
    for (const x of data.marks ?? []) this.stroke({ colour: c.tail, dash: [5, 4], width: 1.5 }, () => { pen.moveTo(px(x), TOP); pen.lineTo(px(x), height); });
    pen.lineJoin = "bevel";
    for (const line of data.lines) {
      this.stroke(line, () => {
        const { x, y, factor = 1 } = line;
        let on = false;
        for (let i = 0; i < x.length; i++) {
          const v = y[i] * factor;
          if (v !== v) { on = false; continue; }
          if (on) pen.lineTo(px(x[i]), py(v));
          else pen.moveTo(px(x[i]), py(v));
          on = true;
        }
      });
    }
    for (const dot of data.dots ?? []) {
      pen.fillStyle = dot.colour;
      pen.beginPath();
      pen.arc(px(dot.x), py(dot.y), 3.5, 0, 7);
      pen.fill();
    }
    pen.restore();
  }

  stroke({ colour, width = 1, dash = [], alpha = 1 }, path) {
    const pen = this.pen;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.globalAlpha = alpha;
    pen.setLineDash(dash);
    pen.beginPath();
    path();
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  extent(data) {
    let [low, high] = this.options.least ?? [Infinity, -Infinity];
    let left = Infinity, right = -Infinity;
    for (const { x, y, factor = 1 } of data.lines) {
      left = Math.min(left, x[0]);
      right = Math.max(right, x[x.length - 1]);
      for (let i = 0; i < y.length; i++) {
        const v = y[i] * factor;
        if (v < low) low = v;
        if (v > high) high = v;
      }
    }
    if (!(high > low)) [low, high] = [low - 1, low + 1];
    if (!Number.isFinite(low)) [low, high] = [0, 1];
    const room = 0.05 * (high - low);
    const top = Math.min(high + room, this.options.most ?? Infinity);
    return { x: [left, right], y: [low - (this.options.floor === low ? 0 : room), top] };
  }
}

function decades(low, high) {
  const found = [];
  for (let e = Math.ceil(Math.log10(low) - 1e-9); 10 ** e <= high * 1.0001; e++) found.push(Number((10 ** e).toPrecision(3)));
  return found;
}

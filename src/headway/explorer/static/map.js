// The stability map: Plotly draws it, a layer of our own above takes clicks and keys and holds the points.

import { tell } from "./scale.js";
import { colours } from "./theme.js";

const MARGIN = { l: 52, r: 12, t: 6, b: 40 };
let loading = null;

// Plotly is large: it is loaded when the first picture stands.
function plotly() {
  loading ??= new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = "plotly.min.js";
    script.onload = () => done(window.Plotly);
    script.onerror = () => failed(new Error("Plotly's script could not be loaded"));
    document.head.append(script);
  });
  return loading;
}

export class StabilityMap {
  // `go` takes the two values that were chosen.
  constructor(place, go) {
    this.place = place;
    this.drawing = place.appendChild(document.createElement("div"));
    this.drawing.className = "drawing";
    this.drawing.style.height = "100%";
    this.over = place.appendChild(document.createElement("div"));
    this.over.className = "over";
    this.over.tabIndex = 0;
    this.over.setAttribute("role", "slider");
    this.over.setAttribute("aria-label", "Current point on the stability map; the arrow keys move it");
    Object.assign(this.over.style, { left: `${MARGIN.l}px`, right: `${MARGIN.r}px`, top: `${MARGIN.t}px`, bottom: `${MARGIN.b}px` });
    this.dots = ["pinned", "here"].map((name) => {
      const dot = this.over.appendChild(document.createElement("div"));
      dot.className = `dot ${name}`;
      dot.hidden = true;
      return dot;
    });
    this.go = go;
    this.over.addEventListener("click", (event) => {
      if (!this.axes) return;
      const box = this.over.getBoundingClientRect();
      this.choose((event.clientX - box.left) / box.width, 1 - (event.clientY - box.top) / box.height);
    });
    this.over.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!move || !this.at) return;
      event.preventDefault();
      const share = this.at.map((v, i) => (v - this.axes[i][1]) / (this.axes[i][2] - this.axes[i][1]) + move[i] / 50);
      this.choose(...share);
    });
    new ResizeObserver(() => this.draw()).observe(place);
  }

  choose(...share) {
    const values = share.map((u, i) => {
      const [, low, high] = this.axes[i];
      return Number((low + (high - low) * Math.min(1, Math.max(0, u))).toPrecision(4));
    });
    this.go(values);
  }

  // Where the points are, at once while a slider moves.
  points(axes, here, pinned) {
    this.axes = axes;
    this.at = here;
    [pinned, here].forEach((at, k) => {
      const share = at?.map((v, i) => (v - axes[i][1]) / (axes[i][2] - axes[i][1]));
      const dot = this.dots[k];
      dot.hidden = !share || share.some((u) => !(u >= 0 && u <= 1));
      if (!dot.hidden) Object.assign(dot.style, { left: `${100 * share[0]}%`, top: `${100 * (1 - share[1])}%` });
    });
    if (here) {
      this.over.setAttribute("aria-valuenow", here[0]);
      this.over.setAttribute("aria-valuetext", axes.map(([name], i) => `${name} ${tell(here[i])}`).join(", "));
    }
  }

  show(map) {
    this.map = map;
    return this.draw();
  }

  async draw() {
    if (!this.map || this.place.clientWidth < 80) return;
    const Plotly = await plotly();
    const { arrays, axes } = this.map, c = colours();
    const steps = [0, 1, 2, 3].flatMap((k) => [[k / 4, c[`map-${k}`]], [(k + 1) / 4, c[`map-${k}`]]]);
    const [bx = [], by = []] = arrays.boundary;
    const axis = (a, range) => ({
      title: { text: `${a.name}${a.unit ? ` [${a.unit}]` : ""}`, standoff: 6 }, range, fixedrange: true, zeroline: false,
      gridcolor: "rgba(0,0,0,0)", tickcolor: c.line, ticks: "outside", nticks: 7, linecolor: c.line,
    });
    const ends = (v) => [v[0], v[v.length - 1]];
    const { clientWidth: width, clientHeight: height } = this.place;
    await Plotly.react(this.drawing, [
      { type: "heatmap", x: arrays.x, y: arrays.y, z: arrays.verdict, zmin: -0.5, zmax: 3.5, colorscale: steps, showscale: false, hoverinfo: "skip" },
      { type: "scatter", mode: "lines", x: bx, y: by, line: { color: c.ink, width: 1.5 }, hoverinfo: "skip" },
    ], {
      margin: MARGIN, width, height, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: "system-ui, sans-serif", size: 11, color: c.soft },
      xaxis: axis(axes[0], ends(arrays.x)), yaxis: axis(axes[1], ends(arrays.y)),
    }, { staticPlot: true, displayModeBar: false });
    this.place.dataset.points = arrays.x.length;
  }

  clear(text) {
    this.map = null;
    this.drawing.replaceChildren(text);
    delete this.place.dataset.points;
  }

  // A picture of the map with its points, for the export.
  async picture() {
    if (!this.map) return null;
    const Plotly = await plotly(), { clientWidth: width, clientHeight: height } = this.place;
    const image = new Image();
    image.src = await Plotly.toImage(this.drawing, { format: "png", width, height, scale: 2 });
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: 2 * width, height: 2 * height }), pen = canvas.getContext("2d");
    pen.drawImage(image, 0, 0);
    for (const dot of this.dots.filter((d) => !d.hidden)) {
      const [x, y] = [dot.offsetLeft + dot.offsetWidth / 2 + MARGIN.l, dot.offsetTop + dot.offsetHeight / 2 + MARGIN.t];
      pen.fillStyle = dot.classList.contains("here") ? colours().ink : colours().pinned;
      pen.strokeStyle = colours().card;
      pen.lineWidth = 4;
      pen.beginPath();
      pen.arc(2 * x, 2 * y, 12, 0, 7);
      pen.fill();
      pen.stroke();
    }
    return canvas;
  }
}

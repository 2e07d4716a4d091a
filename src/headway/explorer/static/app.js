// The page: what moves on the left is asked of the engine, what it answers is drawn on the right.

import { Chart } from "./chart.js";
import { Controls } from "./controls.js";
import { Figures, sayVerdict } from "./figures.js";
import { Link } from "./link.js";
import { StabilityMap } from "./map.js";
import { Player } from "./player.js";
import { Road } from "./road.js";
import { tell } from "./scale.js";
import { picture, take } from "./share.js";
import { Store, copy, decode } from "./state.js";
import { colours, ofVehicle, onTheme } from "./theme.js";

const find = (id) => document.getElementById(id);
const told = await (await fetch("hello")).json();
const store = new Store(decode(location.hash) ?? copy(told.state));

let run = null, pinned = null, asked = 0;

const seek = (time) => player.seek(time);
const charts = {
  speed: new Chart(find("speed"), { x: "time [s]", label: "Speed of every vehicle over time", onTime: seek }),
  spacing: new Chart(find("spacing"), { x: "time [s]", label: "Spacing error of every follower over time", onTime: seek }),
  space: new Chart(find("space"), { x: "time [s]", label: "Position of every vehicle over time", onTime: seek }),
  gain: new Chart(find("gain"), { x: "frequency [rad/s]", label: "Gain per vehicle over frequency", log: true, least: [0, 1.2], floor: 0, most: 6 }),
};
const timed = [charts.speed, charts.spacing, charts.space];
const road = new Road(find("road"));
const figures = new Figures(find("figures"));
const map = new StabilityMap(find("map"), (values) => {
  store.state.map.forEach(([name], i) => assign(name, values[i]));
  store.changed();
});
const player = new Player((time) => {
  if (!run) return;
  road.draw(run, time);
  for (const chart of timed) chart.showTime(time);
});

// -- a run on the charts ---------------------------------------------------------------------------

function lines(source, what, factor = 1, faded = false) {
  const { time, [what]: rows } = source.arrays, c = colours(), count = rows.length - (what === "error" ? 0 : 1);
  const found = rows.map((y, n) => ({
    x: time, y, factor, width: 1.1, colour: faded ? c.pinned : ofVehicle(what === "error" ? n : n - 1, count), alpha: faded ? 0.65 : 1,
  }));
  if (what !== "error") Object.assign(found[0], { colour: faded ? c.pinned : c.ink, width: 1.6, dash: what === "speed" ? [6, 3] : [] });
  return what === "error" ? found : [...found.slice(1), found[0]];
}

function draw() {
  if (!run) return;
  const both = (what, factor) => [...(pinned ? lines(pinned, what, factor, true) : []), ...lines(run, what, factor)];
  charts.speed.draw({ lines: both("speed") });
  charts.spacing.draw({ lines: both("error"), level: 0 });
  charts.space.draw({ lines: both("position", 0.001) });
  const c = colours(), gain = [];
  if (pinned?.arrays.gain) gain.push({ x: pinned.arrays.omega, y: pinned.arrays.gain, colour: c.pinned, width: 2 });
  if (run.arrays.gain) gain.push({ x: run.arrays.omega, y: run.arrays.gain, colour: c.accent, width: 2 });
  const peak = run.theory.peak, dots = peak && peak[0] > 0.01 ? [{ x: peak[0], y: peak[1], colour: c.accent }] : [];
  charts.gain.draw({ lines: gain, level: 1, marks: run.marks, dots });
  const [end] = run.arrays.time.slice(-1);
  if (end !== player.end) player.until(end);
  player.show(player.time);
}

function badge() {
  const { word, peak, error } = run.theory, place = find("badge");
  const grows = word === "string unstable" && peak ? `, ${tell(peak[1], 3)}× at ${tell(peak[0], 2)} rad/s` : "";
  place.value = word ? word + grows : "no equilibrium";
  place.dataset.word = word ?? "";
}

// -- the point on the map --------------------------------------------------------------------------

function current(name, scenario = store.scenario, group = scenario.followers[store.state.group]) {
  if (!group) return undefined;
  const [head, signal] = name.split(".");
  const delay = group.delay ?? 0;
  if (name === "speed") return scenario.leader.mean ?? scenario.leader.speed;
  if (name === "lag") return group.lag ?? 0;
  const longest = (radio) => Math.max(0, ...Object.keys(delay).filter((s) => byRadio(group, s) === radio).map((s) => delay[s]));
  if (name === "delay") return typeof delay === "object" ? longest(false) : delay;
  if (name === "radio_delay") return typeof delay === "object" ? longest(true) : 0;
  if (head === "delay") return typeof delay === "object" ? delay[signal] ?? 0 : told.signals[signal].radio ? 0 : delay;
  return group.parameters?.[name] ?? told.models[group.model].parameters.find((p) => p.name === name)?.start;
}

// vl on a law that asks for dv alone is the leader's speed in it, which is seen and not received
function byRadio(group, signal) {
  return told.signals[signal].radio && told.models[group.model].signals.includes(signal);
}

let reshaped = false;

function assign(name, value) {
  const { scenario, group } = store, [head, signal] = name.split(".");
  if (name === "speed") scenario.leader["mean" in scenario.leader ? "mean" : "speed"] = value;
  else if (name === "lag") group.lag = value;
  else if (name === "delay") {
    reshaped ||= typeof group.delay === "object";
    group.delay = value;
  } else if (name === "radio_delay") {
    const signals = told.models[group.model].signals, given = group.delay ?? 0;
    reshaped ||= typeof given !== "object";
    const own = typeof given === "object" ? given : Object.fromEntries(signals.filter((s) => !told.signals[s].radio).map((s) => [s, given]));
    group.delay = { ...own, ...Object.fromEntries(signals.filter((s) => told.signals[s].radio).map((s) => [s, value])) };
  } else if (head === "delay") {
    reshaped ||= typeof group.delay !== "object";
    if (typeof group.delay !== "object") {
      const alike = group.delay ?? 0;
      group.delay = Object.fromEntries(told.models[group.model].signals.filter((s) => !told.signals[s].radio).map((s) => [s, alike]));
    }
    group.delay[signal] = value;
  } else (group.parameters ??= {})[name] = value;
}

function place() {
  const axes = store.state.map;
  if (!axes) return;
  const at = (...of) => {
    const values = axes.map(([name]) => current(name, ...of));
    return values.every(Number.isFinite) ? values : null;
  };
  const before = store.state.pinned;
  map.points(axes, at(), before ? at(before, before.followers[store.state.group]) : null);
}

function axesControls() {
  const law = told.models[store.group.model], where = find("axes");
  store.state.map ??= copy(law.map);
  where.replaceChildren(...store.state.map.flatMap((axis, i) => {
    const which = "xy"[i];
    const select = document.createElement("select");
    select.setAttribute("aria-label", `What the ${which} axis of the map is`);
    for (const name of Object.keys(law.axes)) if (name === axis[0] || name !== store.state.map[1 - i][0]) select.add(new Option(name, name, false, name === axis[0]));
    select.addEventListener("change", () => {
      store.state.map[i] = [select.value, ...law.axes[select.value]];
      store.changed(true);
    });
    const ends = [1, 2].map((k) => {
      const input = Object.assign(document.createElement("input"), { type: "number", step: "any", value: axis[k] });
      input.setAttribute("aria-label", `${k === 1 ? "Least" : "Largest"} value on the ${which} axis`);
      input.addEventListener("change", () => {
        const changed = [...store.state.map[i]];
        changed[k] = input.valueAsNumber;
        if (changed[1] < changed[2]) store.state.map[i] = changed;
        store.changed(true);
      });
      return input;
    });
    return [which, select, ends[0], "to", ends[1]];
  }));
}

find("legend").append(...[[3, "string stable"], [2, "string unstable"], [1, "locally unstable"], [0, "no equilibrium"]].map(([k, text]) => {
  const entry = document.createElement("span");
  entry.append(Object.assign(document.createElement("i"), { className: `c${k}` }), text);
  return entry;
}));

// -- what the engine says --------------------------------------------------------------------------

function hear(message, since) {
  const { kind } = message;
  if (kind === "error") {
    complain(message.text);
    return;
  }
  if (kind === "curves") {
    if (!link.fresh(message)) return;
    complain("");
    run = message;
    draw();
    badge();
    if (message.draft) painted(since, message.server_ms);
  } else if (kind === "pinned") {
    pinned = message;
    draw();
  } else if (kind === "pinned figures") figures.pin(message.figures);
  // a map is sent once for all states that share it, so it holds whichever state it was made for
  else if (kind === "map") map.show(message);
  else if (!link.fresh(message)) return;
  else if (kind === "figures") figures.show(message.figures);
  else if (kind === "verdict") sayVerdict(find("verdict"), message.sentences);
  else if (kind === "no map") map.clear(message.text);
}

// How long it took from the hand to the picture; the browser's own record of it is what benchmarks read.
function painted(since, engine) {
  if (since === null) return;
  requestAnimationFrame(() => setTimeout(() => {
    performance.clearMeasures("answer");
    const { duration } = performance.measure("answer", { start: since, detail: { engine } });
    find("timing").value = `hand to picture ${duration.toFixed(0)} ms, engine ${engine.toFixed(1)} ms`;
  }));
}

function complain(text) {
  const where = find("error");
  if (where.textContent !== text) where.textContent = text;
  where.hidden = !text;
}

const points = () => Math.round(Math.min(800, Math.max(200, 1.3 * charts.speed.width)));
const link = new Link(hear, (text) => { find("status").textContent = text === "ready" ? `headway ${told.version}, on this machine` : text; });

function ask() {
  find("verdict").classList.add("old");
  link.show(wire(), points(), asked || performance.now());
  asked = 0;
}

function wire() {
  const { scenario, group, map: axes } = store.state;
  return { scenario, group, map: axes };
}

addEventListener("input", (event) => { asked = event.timeStamp; }, true);
store.addEventListener("change", (event) => {
  if (reshaped && !event.detail.shape) {
    reshaped = false;
    store.changed(true);
    return;
  }
  if (event.detail.shape) axesControls();
  place();
  ask();
});

// -- compare and share -----------------------------------------------------------------------------

function pin(on = !store.state.pinned) {
  if (on && run) {
    store.state.pinned = copy(store.scenario);
    pinned = run;
    figures.pin(figures.now);
  } else {
    delete store.state.pinned;
    pinned = null;
    figures.pin(null);
  }
  showPin();
  place();
  draw();
  store.remember();
}

function showPin() {
  const on = Boolean(store.state.pinned);
  find("pin").setAttribute("aria-pressed", on);
  find("pin").textContent = on ? "Unpin" : "Pin";
}

function restorePin() {
  showPin();
  if (store.state.pinned) link.pin({ ...wire(), scenario: store.state.pinned, group: Math.min(store.state.group, store.state.pinned.followers.length - 1) }, points());
  else {
    pinned = null;
    figures.pin(null);
  }
}

find("pin").addEventListener("click", () => pin());
find("copy").addEventListener("click", async () => {
  store.remember();
  await navigator.clipboard.writeText(location.href);
  find("copy").textContent = "Copied";
  setTimeout(() => { find("copy").textContent = "Copy link"; }, 1200);
});
for (const button of document.querySelectorAll(".take")) {
  button.addEventListener("click", () => take(button.dataset.form, wire()).catch((error) => complain(error.message)));
}
find("png").addEventListener("click", async () => {
  const cards = [["", find("road")], ["Speeds [m/s]", charts.speed.canvas], ["Spacing errors [m]", charts.spacing.canvas],
    ["Time–space diagram [km]", charts.space.canvas], ["Gain |G(iω)| per vehicle", charts.gain.canvas]];
  const image = await map.picture();
  if (image) cards.push(["Stability map", image]);
  await picture(cards, [...find("verdict").children].map((p) => p.textContent));
});
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input:not([type=range]), select")) return;
  if (event.key === "p") pin();
  else if (event.key === " " && !event.target.closest("button, summary")) {
    event.preventDefault();
    player.toggle();
  }
});
addEventListener("hashchange", () => {
  const state = decode(location.hash);
  if (!state) return;
  store.replace(state);
  restorePin();
});
onTheme(() => {
  draw();
  map.draw();
});

new Controls(find("controls"), told, store);
axesControls();
place();
ask();
if (store.state.pinned) link.socket.addEventListener("open", restorePin, { once: true });

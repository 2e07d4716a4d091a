// The left side: every control is made from what the server says about laws, leaders and vehicles.

import { STEPS, fromSlider, tell, toSlider } from "./scale.js";

let serial = 0;

function make(tag, options = {}, ...children) {
  const { dataset, ...rest } = options;
  const element = Object.assign(document.createElement(tag), rest);
  Object.assign(element.dataset, dataset ?? {});
  element.append(...children);
  return element;
}

function choice(label, options, value, pick) {
  const id = `c${++serial}`;
  const select = make("select", { id }, ...options.map(([v, text]) => make("option", { value: v, textContent: text, selected: v === value })));
  select.addEventListener("change", () => pick(select.value));
  return make("div", { className: "field" }, make("label", { htmlFor: id, textContent: label }), select);
}

// One number: a slider for the hand, a field for the exact value.
function number(field, get, set) {
  const id = `c${++serial}`;
  const range = make("input", { type: "range", min: 0, max: STEPS, step: 1, id, dataset: { field: field.name } });
  const exact = make("input", { type: "number", step: "any", ariaLabel: `${field.name}, exact value` });
  const show = (value) => {
    range.value = toSlider(value ?? field.slider.low, field.slider);
    range.setAttribute("aria-valuetext", `${tell(value)} ${field.unit}`);
    if (document.activeElement !== exact) exact.value = value === null || value === undefined ? "" : Number(value.toPrecision(5));
  };
  range.addEventListener("input", () => {
    const value = fromSlider(Number(range.value), field.slider, field.whole);
    set(value);
    exact.value = value;
    range.setAttribute("aria-valuetext", `${tell(value)} ${field.unit}`);
  });
  exact.addEventListener("change", () => {
    if (exact.value === "" || !Number.isFinite(exact.valueAsNumber)) { show(get()); return; }
    set(exact.valueAsNumber);
    show(get());
  });
  const label = make("label", { htmlFor: id, title: field.text }, field.name, make("span", { textContent: field.text }));
  const element = make("div", { className: "field" }, label,
    make("div", { className: "value" }, exact, make("i", { textContent: field.unit })), range);
  element.refresh = () => show(get());
  element.refresh();
  return element;
}

function text(field, get, set) {
  const id = `c${++serial}`;
  const list = field.type === "numbers";
  const shown = () => (list ? (get() ?? []).join(", ") : get() ?? "");
  const input = make("input", { type: "text", id, value: shown() });
  input.addEventListener("change", () => {
    if (!list) { set(input.value); return; }
    const values = input.value.split(/[\s,;]+/).filter(Boolean).map(Number);
    if (values.every(Number.isFinite)) set(values); else input.value = shown();
  });
  const label = make("label", { htmlFor: id, title: field.text }, field.name, make("span", { textContent: `${field.unit} ${field.text}` }));
  return make("div", { className: "field" }, label, input);
}

export class Controls {
  constructor(place, told, store) {
    Object.assign(this, { place, told, store, open: { disturbance: true, model: true, delays: true, vehicles: true } });
    store.addEventListener("change", (event) => (event.detail.shape ? this.build() : this.refresh()));
    this.build();
  }

  refresh() { for (const field of this.fields) field.refresh?.(); }

  build() {
    const focus = document.activeElement?.dataset?.keep;
    this.fields = [];
    this.place.replaceChildren(
      this.part("vehicles", "Vehicles", this.vehicles()), this.part("model", "Model", this.model()),
      this.part("delays", "Delays", this.delays()), this.part("disturbance", "Disturbance", this.disturbance()),
      this.part("run", "Run", this.run()),
    );
    if (focus) this.place.querySelector(`[data-keep="${focus}"]`)?.focus();
  }

  part(name, title, content) {
    const details = make("details", { open: this.open[name] ?? false }, make("summary", { textContent: title }), ...content);
    details.addEventListener("toggle", () => { this.open[name] = details.open; });
    return details;
  }

  add(element) {
    this.fields.push(element);
    return element;
  }

  // A control for a field of a table of the state; a table is looked up when it is needed, it may have been replaced.
  field(field, table) {
    const get = () => table()[field.name] ?? field.default ?? (field.type === "number" ? field.start : undefined);
    const set = (value) => {
      table()[field.name] = value;
      this.store.changed();
    };
    if (field.type === "choice") return choice(field.name, field.choices.map((c) => [c, c]), get(), set);
    return this.add(field.type === "number" ? number(field, get, set) : text(field, get, set));
  }

  vehicles() {
    const { store, told } = this, groups = store.scenario.followers;
    const tabs = make("div", { className: "tabs", role: "group", ariaLabel: "Groups of vehicles, front to back" });
    groups.forEach((g, i) => {
      const tab = make("button", { type: "button", textContent: `${g.count ?? 1} × ${g.model}`, dataset: { keep: `tab${i}` } });
      tab.setAttribute("aria-pressed", i === store.state.group);
      tab.addEventListener("click", () => this.select(i));
      tabs.append(tab);
      this.add(Object.assign(tab, { refresh: () => { tab.textContent = `${store.scenario.followers[i]?.count ?? 1} × ${g.model}`; } }));
    });
    const more = make("button", { type: "button", textContent: "+", title: "Add a group behind", ariaLabel: "Add a group behind" });
    more.addEventListener("click", () => {
      groups.push({ ...JSON.parse(JSON.stringify(store.group)), count: 1 });
      this.select(groups.length - 1);
    });
    tabs.append(more);
    if (groups.length > 1) {
      const less = make("button", { type: "button", textContent: "−", title: "Remove this group", ariaLabel: "Remove this group" });
      less.addEventListener("click", () => {
        groups.splice(store.state.group, 1);
        this.select(Math.max(0, store.state.group - 1));
      });
      tabs.append(less);
    }
    const count = {
      name: "count", unit: "", text: "vehicles of this group", whole: true, type: "number", default: 1, start: 1,
      slider: { low: 1, high: Math.min(60, told.limits.vehicles), scale: "power", p: 1.5 },
    };
    return [tabs, this.field(count, () => store.group), ...told.vehicle.map((f) => this.field(f, () => store.group))];
  }

  select(group) {
    this.store.state.group = group;
    const axes = this.told.models[this.store.group.model].axes;
    if (!this.store.state.map?.every(([name]) => name in axes)) this.store.state.map = this.told.models[this.store.group.model].map;
    this.store.changed(true);
  }

  model() {
    const { store, told } = this, law = told.models[store.group.model];
    const names = Object.entries(told.models).map(([name, m]) => [name, `${name}: ${m.title}`]);
    const pick = choice("model", names, store.group.model, (name) => this.take(name));
    pick.querySelector("select").dataset.keep = "model";
    store.group.parameters ??= {};
    return [pick, make("p", { className: "formula", textContent: law.formula }),
      ...law.parameters.map((p) => this.field(p, () => (store.group.parameters ??= {})))];
  }

  take(name) {
    const { store, told } = this, group = store.group, law = told.models[name];
    group.model = name;
    group.parameters = Object.fromEntries(law.parameters.map((p) => [p.name, p.start]));
    if (typeof group.delay === "object") group.delay = Math.max(0, ...Object.values(group.delay));
    store.state.map = JSON.parse(JSON.stringify(law.map));
    if (law.rests && store.scenario.gaps === undefined) store.scenario.gaps = 30;
    else if (!store.scenario.followers.some((f) => told.models[f.model].rests)) delete store.scenario.gaps;
    store.changed(true);
  }

  delays() {
    const { store, told } = this, law = told.models[store.group.model];
    const delay = () => store.group.delay ?? 0;
    const each = typeof delay() === "object";
    const alone = each && "vl" in delay() && !law.signals.includes("vl");
    const ways = [["all", "all on-board signals alike"], ["each", "each signal its own"]];
    if (law.signals.includes("dv") && !law.signals.includes("vl")) ways.push(["alone", "each its own, the leader's speed apart"]);
    const pick = choice("late", ways, alone ? "alone" : each ? "each" : "all", (way) => {
      const now = typeof delay() === "object" ? Math.max(0, ...Object.values(delay())) : delay();
      if (way === "all") store.group.delay = now;
      else {
        const signals = law.signals.map((s) => (way === "alone" && s === "dv" ? "vl" : s));
        const known = typeof delay() === "object" ? delay() : null;
        store.group.delay = Object.fromEntries(signals.map((s) => [s, known?.[s] ?? (told.signals[s].radio && !known ? (way === "alone" ? now : 0) : now)]));
      }
      store.changed(true);
    });
    pick.querySelector("select").dataset.keep = "late";
    if (!each) {
      const set = (value) => { store.group.delay = value; store.changed(); };
      return [pick, this.add(number({ name: "delay", ...told.delay }, () => (typeof delay() === "object" ? 0 : delay()), set))];
    }
    const signals = law.signals.map((s) => (alone && s === "dv" ? "vl" : s));
    return [pick, ...signals.map((s) => {
      const set = (value) => { store.group.delay = { ...store.group.delay, [s]: value }; store.changed(); };
      const field = { name: s, unit: told.delay.unit, slider: told.delay.slider, text: `delay of the ${told.signals[s].text}` };
      return this.add(number(field, () => delay()[s] ?? 0, set));
    })];
  }

  disturbance() {
    const { store, told } = this, leader = () => store.scenario.leader, now = leader().kind;
    const kinds = Object.keys(told.kinds).filter((k) => k !== "recorded" || now === k);
    const pick = choice("kind", kinds.map((k) => [k, k]), now, (kind) => {
      const before = leader();
      store.scenario.leader = { kind };
      for (const f of told.kinds[kind].fields) {
        const speed = before.mean ?? before.speed;
        const kept = before[f.name] ?? (["mean", "speed"].includes(f.name) && typeof speed === "number" ? speed : undefined);
        if (f.required) store.scenario.leader[f.name] = kept ?? f.start;
      }
      store.scenario.duration ??= 60;
      store.changed(true);
    });
    pick.querySelector("select").dataset.keep = "kind";
    const fixed = ["file", "format", "columns", "units", "time", "speed", "vehicle"];
    const fields = told.kinds[now].fields.filter((f) => !(now === "recorded" && fixed.includes(f.name)));
    return [pick, make("p", { className: "formula", textContent: told.kinds[now].text.replaceAll("`", "") }),
      ...fields.filter((f) => f.required || f.default !== null || leader()[f.name] !== undefined).map((f) => this.field(f, leader))];
  }

  run() {
    const { store, told } = this;
    return told.run
      .filter((f) => (f.name === "gaps" ? typeof store.scenario.gaps === "number" : f.name !== "seed" || told.kinds[store.scenario.leader.kind].random))
      .filter((f) => f.name !== "duration" || store.scenario.duration !== undefined)
      .map((f) => this.field(f, () => store.scenario));
  }
}

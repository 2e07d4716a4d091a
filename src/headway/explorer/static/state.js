// The whole state of the page, in one object and in the address.

export class Store extends EventTarget {
  constructor(state) {
    super();
    this.state = state;
    this.timer = 0;
  }

  get scenario() { return this.state.scenario; }
  get group() { return this.state.scenario.followers[this.state.group]; }

  // `shape`: the controls themselves have to be made anew.
  changed(shape = false) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.remember(), 250);
    this.dispatchEvent(new CustomEvent("change", { detail: { shape } }));
  }

  remember() { history.replaceState(null, "", "#" + encode(this.state)); }

  replace(state) {
    this.state = state;
    this.changed(true);
  }
}

export function encode(state) {
  const bytes = new TextEncoder().encode(JSON.stringify(state));
  let text = "";
  for (const b of bytes) text += String.fromCharCode(b);
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

// The state in an address, or null where there is none that could be one.
export function decode(hash) {
  try {
    const text = atob(hash.replace(/^#/, "").replaceAll("-", "+").replaceAll("_", "/"));
    const state = JSON.parse(new TextDecoder().decode(Uint8Array.from(text, (c) => c.charCodeAt(0))));
    const leads = state?.scenario?.leader && Array.isArray(state.scenario.followers) && state.scenario.followers.length;
    if (!leads) return null;
    state.group = Math.min(Math.max(0, state.group | 0), state.scenario.followers.length - 1);
    return state;
  } catch {
    return null;
  }
}

export const copy = (value) => JSON.parse(JSON.stringify(value));

// The conversation with the engine: one request at a time on its way, and only the newest waits. What is answered
// late is overtaken: the engine gives up the older state when it hears of a newer one.

// how long [ms] a newer state waits for the picture of an older one
const PATIENCE = 300;

export class Link {
  constructor(hear, status) {
    this.hear = hear;
    this.status = status;
    this.number = 0;
    this.shown = 0;
    this.flying = null;
    this.waiting = null;
    this.open();
  }

  open() {
    const url = new URL("ws", location.href);
    url.protocol = "ws:";
    url.hash = "";
    this.socket = new WebSocket(url);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.status("ready");
      this.flying = null;
      this.send();
    };
    this.socket.onmessage = (event) => this.take(event.data);
    this.socket.onclose = (event) => {
      this.status(event.reason ? `the engine hung up: ${event.reason}` : "the engine has gone; trying again …");
      this.waiting ??= this.last;
      setTimeout(() => this.open(), 1000);
    };
  }

  // Ask for the pictures of a state; `asked` is when the hand moved.
  show(state, points, asked) {
    this.waiting = { state, points, asked };
    this.last = this.waiting;
    this.send();
  }

  pin(state, points) {
    this.transmit({ do: "pin", id: ++this.number, state, points });
  }

  send() {
    clearTimeout(this.overtaking);
    if (!this.waiting) return;
    const rest = this.flying ? this.flying.sent + PATIENCE - performance.now() : 0;
    if (rest > 0) {
      this.overtaking = setTimeout(() => this.send(), rest);
      return;
    }
    const { state, points, asked } = this.waiting;
    const id = ++this.number;
    if (!this.transmit({ do: "show", id, state, points })) return;
    this.waiting = null;
    this.shown = id;
    this.flying = { id, asked, sent: performance.now() };
  }

  transmit(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  take(data) {
    const message = typeof data === "string" ? JSON.parse(data) : unpack(data);
    let asked = null;
    if (this.flying && message.id === this.flying.id && (message.kind === "curves" || message.kind === "error")) {
      asked = this.flying.asked;
      this.flying = null;
    }
    this.send();
    this.hear(message, asked);
  }

  // Whether a message is about what the page shows now; drafts are drawn while newer ones are on their way.
  fresh(message) { return message.id === this.shown || Boolean(message.draft); }
}

// A binary message, see session.py.
function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const arrays = {};
  for (const [name, shape] of header.arrays) {
    const size = shape.reduce((a, b) => a * b, 1);
    const flat = new Float32Array(buffer, at, size);
    at += 4 * size;
    arrays[name] = shape.length === 1 ? flat
      : Array.from({ length: shape[0] }, (_, i) => flat.subarray(i * shape[1], (i + 1) * shape[1]));
  }
  return { ...header, arrays };
}

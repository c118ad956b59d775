// @ts-check
// The WebSocket: opened again for ever.

/** Milliseconds between tries, and after which a silent server is lost. */
const [TRY_MIN, TRY_MAX, SILENCE] = [250, 5000, 6000];

export class Connection extends EventTarget {
  constructor() {
    super();
    /** @type {WebSocket | null} */
    this.socket = null;
    this.wait = TRY_MIN;
    this.heard = 0;
    this.beaten = 0;
    /** Milliseconds there and back; smoothed. */
    this.round_trip = 0;
    this.isOpen = false;
    this.timer = 0;
    setInterval(() => this.beat(), 1000);
    document.addEventListener("visibilitychange", () => !document.hidden && !this.socket && this.open());
    this.open();
  }

  open() {
    clearTimeout(this.timer);
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heard = performance.now();
    socket.onopen = () => {
      this.wait = TRY_MIN;
      this.isOpen = true;
      this.tell("state", { open: true });
      this.beat();
    };
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      // Browsers slow the clocks of pages in the background, but hand them what comes.
      if (this.heard - this.beaten > 1500) this.beat();
      if (typeof event.data !== "string") this.tell("picture", event.data);
      else this.message(JSON.parse(event.data));
    };
    socket.onclose = () => this.lost(socket);
  }

  /** @param {WebSocket} socket */
  lost(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    this.isOpen = false;
    // Pages that lost the same server do not come back at the same moment.
    const wait = this.wait * (0.75 + Math.random() / 2);
    this.wait = Math.min(this.wait * 2, TRY_MAX);
    this.timer = setTimeout(() => this.open(), wait);
    this.tell("state", { open: false, again_ms: wait });
  }

  /** Opens it once more, as after a login. */
  again() {
    const socket = this.socket;
    this.socket = null;
    this.isOpen = false;
    socket?.close();
    this.wait = TRY_MIN;
    this.open();
  }

  beat() {
    if (!this.socket) return;
    this.beaten = performance.now();
    if (performance.now() - this.heard > SILENCE) {
      const socket = this.socket;
      socket.close();
      this.lost(socket);
    } else this.send({ kind: "ping", t: performance.now() });
  }

  /** @param {any} message @returns {boolean} it was sent */
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(typeof message === "string" ? message : JSON.stringify(message));
    return true;
  }

  /** @param {any} message */
  message(message) {
    if (message.kind === "pong") {
      const took = performance.now() - message.t;
      this.round_trip = this.round_trip ? this.round_trip * 0.8 + took * 0.2 : took;
    } else this.tell(message.kind, message);
  }

  /** @param {string} kind @param {any} detail */
  tell(kind, detail) {
    this.dispatchEvent(new CustomEvent(kind, { detail }));
  }

  /** @param {string} kind @param {(detail: any) => void} listener */
  on(kind, listener) {
    this.addEventListener(kind, (event) => listener(/** @type {CustomEvent} */ (event).detail));
  }
}

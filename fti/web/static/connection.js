// The WebSocket: reconnects for ever; says at once when nothing arrives any more.

import { clock } from "./format.js";
import { setClass, setText } from "./dom.js";

const SILENCE_MS = 2000;
const RETRY_MS = 1000;

export class Connection {
  constructor(onMessage) {
    this.onMessage = onMessage;
    this.lastAt = null; // time of the last message, for the age
    this.open = false;
    setInterval(() => this.#watch(), 250);
    this.#connect();
  }

  #connect() {
    const socket = new WebSocket(`ws://${location.host}/ws`);
    socket.onmessage = (event) => {
      this.lastAt = Date.now();
      this.open = true;
      this.onMessage(JSON.parse(event.data));
      this.#watch();
    };
    socket.onclose = () => {
      this.open = false;
      this.#watch();
      setTimeout(() => this.#connect(), RETRY_MS);
    };
  }

  #watch() {
    const silent = this.lastAt === null || Date.now() - this.lastAt > SILENCE_MS;
    const lost = !this.open || silent;
    setClass(document.body, "disconnected", lost);
    if (lost) setText(document.getElementById("no-connection-text"), this.#since());
  }

  #since() {
    if (this.lastAt === null) return "connecting; nothing has been received yet";
    const seconds = Math.round((Date.now() - this.lastAt) / 1000);
    return `values are frozen since ${clock(this.lastAt * 1e6)} UTC (${seconds} s)`;
  }
}

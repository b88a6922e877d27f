// The WebSocket: reconnects for ever, detects silence, sends the commands of the page.

import { clock } from "./format.js";
import { closeDialogs } from "./dialog.js";
import { takeKey } from "./key.js";
import { setClass, setText } from "./dom.js";

const SILENCE_MS = 2000;
const RETRY_MS = 1000;
const MAX_MESSAGE_BYTES = 2048; // bytes of a message; the server closes the connection at a longer one

// Why a command has no answer; it may have arrived.
export const LOST = "the connection was lost";
const NOT_CONNECTED = "no connection";

export class Connection {
  // onPermission : called with the reason why this page may not command, or null
  constructor(onMessage, onPermission) {
    this.onMessage = onMessage;
    this.onPermission = onPermission;
    this.lastAt = null; // time of the last message, for the age
    this.open = false;
    this.stopped = false; // the last session state was "stopped"
    this.key = takeKey();
    this.waiting = new Map(); // resolver of the answer by command number
    this.commands = 0;
    setInterval(() => this.#watch(), 250);
    addEventListener("hashchange", () => {
      this.key = takeKey();
      this.#askPermission();
    });
    this.#connect();
  }

  // Sends a command; resolves to the reason of its refusal, or to null.
  command(fields) {
    if (!this.open || this.#isSilent()) return Promise.resolve(NOT_CONNECTED);
    this.commands += 1;
    const id = this.commands;
    const text = JSON.stringify({ ...fields, id, key: this.key });
    if (new TextEncoder().encode(text).length > MAX_MESSAGE_BYTES) return Promise.resolve("the command is too long");
    this.socket.send(text);
    return new Promise((resolve) => this.waiting.set(id, resolve));
  }

  #answer(id, fault) {
    this.waiting.get(id)?.(fault);
    this.waiting.delete(id);
  }

  #connect() {
    const socket = new WebSocket(`ws://${location.host}${new URL("ws", document.baseURI).pathname}`);
    this.socket = socket;
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      const isFirst = !this.open;
      this.lastAt = Date.now();
      this.open = true;
      if (message.health) this.stopped = message.health.session.state === "stopped";
      if (isFirst) this.#askPermission();
      if (message.type === "answer") this.#answer(message.id, message.fault);
      else this.onMessage(message);
      this.#watch();
    };
    socket.onclose = () => {
      this.open = false;
      for (const id of [...this.waiting.keys()]) this.#answer(id, LOST);
      this.#watch();
      setTimeout(() => this.#connect(), RETRY_MS);
    };
  }

  // Tests the key; a restarted daemon has another one.
  async #askPermission() {
    const fault = await this.command({ command: "check" });
    if (fault !== LOST && fault !== NOT_CONNECTED) this.onPermission(fault);
  }

  #isSilent() {
    return this.lastAt === null || Date.now() - this.lastAt > SILENCE_MS;
  }

  #watch() {
    const lost = !this.open || this.#isSilent();
    setClass(document.body, "disconnected", lost);
    setClass(document.body, "stopped", this.stopped);
    if (!lost) return;
    closeDialogs();
    setText(document.getElementById("no-connection-title"), this.stopped ? "STOPPED" : "NO CONNECTION TO THE DAEMON");
    setText(document.getElementById("no-connection-text"), this.#since());
  }

  #since() {
    if (this.lastAt === null) return "connecting; no data received yet";
    if (this.stopped) return `the session has ended at ${clock(this.lastAt * 1e6)} UTC; these were its last values`;
    const seconds = Math.round((Date.now() - this.lastAt) / 1000);
    return `values are frozen since ${clock(this.lastAt * 1e6)} UTC (${seconds} s)`;
  }
}

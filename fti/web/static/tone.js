// A tone while a warning is not acknowledged; off until it is enabled in this browser.

import { h, setAttribute, setText } from "./dom.js";

const NAME = "fti-tone";
const PERIOD_MS = 1000;
const HERTZ = 880;

// Without storage the choice is lost with the page.
function remembered() {
  try {
    return localStorage.getItem(NAME) === "on";
  } catch {
    return false;
  }
}

function remember(on) {
  try {
    localStorage.setItem(NAME, on ? "on" : "off");
  } catch {
    // the choice applies to this page only
  }
}

export class Tone {
  constructor() {
    this.button = h("button", { type: "button", "data-testid": "tone" });
    this.button.addEventListener("click", () => this.#choose(!this.on));
    this.due = 0;
    this.on = remembered();
    this.#show();
    // A browser permits sound after a user action.
    for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => this.#start());
  }

  sound(isDue) {
    if (!isDue || this.context?.state !== "running" || !this.on || Date.now() < this.due) return;
    this.due = Date.now() + PERIOD_MS;
    const tone = this.context.createOscillator();
    tone.frequency.value = HERTZ;
    tone.connect(this.context.destination);
    tone.start();
    tone.stop(this.context.currentTime + 0.2);
  }

  async #start() {
    if (!this.on || this.context?.state === "running") return;
    this.context ??= new AudioContext();
    await this.context.resume();
    this.#show();
  }

  #choose(on) {
    this.on = on;
    remember(on);
    this.#show();
    this.#start();
  }

  #show() {
    const isSilent = this.on && this.context?.state !== "running";
    setText(this.button, isSilent ? "TONE: CLICK" : this.on ? "TONE ON" : "TONE OFF");
    setAttribute(this.button, "aria-pressed", this.on);
  }
}

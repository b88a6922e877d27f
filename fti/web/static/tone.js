// A tone while a warning lasts that nobody has acknowledged; off until a person chooses it, in this browser.

import { h, setAttribute, setText } from "./dom.js";

const NAME = "fti-tone";
const PERIOD_MS = 1000;
const HERTZ = 880;

export class Tone {
  constructor() {
    this.button = h("button", { type: "button", "data-testid": "tone" });
    this.button.addEventListener("click", () => this.#choose(!this.on));
    this.due = 0;
    this.#choose(localStorage.getItem(NAME) === "on");
  }

  sound(isDue) {
    if (!isDue || !this.on || Date.now() < this.due) return;
    this.due = Date.now() + PERIOD_MS;
    this.context ??= new AudioContext();
    const tone = this.context.createOscillator();
    tone.frequency.value = HERTZ;
    tone.connect(this.context.destination);
    tone.start();
    tone.stop(this.context.currentTime + 0.2);
  }

  #choose(on) {
    this.on = on;
    localStorage.setItem(NAME, on ? "on" : "off");
    setText(this.button, on ? "TONE ON" : "TONE OFF");
    setAttribute(this.button, "aria-pressed", on);
  }
}

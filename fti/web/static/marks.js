// Marks: the field that sets one (m on the keyboard), and the marks among the events, for the plots.

import { h, setText } from "./dom.js";

const LONGEST = 200;
const SHOWN_MS = 4000;

export const marksOf = (events) =>
  events.filter(({ source }) => source === "mark").map(({ t_ns: tNs, text }) => ({ t: tNs / 1e9, text }));

export class MarkField {
  // command : gives a command to the daemon, resolves to why it was refused or to null
  constructor(command) {
    this.command = command;
    this.input = h("input", { type: "text", maxlength: LONGEST, placeholder: "mark (press m)", "aria-label": "text of the mark", autocomplete: "off", "data-testid": "mark-text" });
    const button = h("button", { type: "submit", "data-testid": "mark-button" }, "MARK");
    this.answer = h("output", { "data-testid": "mark-answer" });
    this.root = h("form", { class: "mark" }, this.input, button, this.answer);
    this.root.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send();
    });
    this.input.addEventListener("keydown", (event) => event.key === "Escape" && this.input.blur());
    document.addEventListener("keydown", (event) => this.#onKey(event));
  }

  #onKey(event) {
    const typing = event.target.closest?.("input, textarea");
    if (event.key !== "m" || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.input.focus();
  }

  // An empty field is a mark too: there may be no time for words.
  async #send() {
    const text = this.input.value.trim() || "mark";
    this.input.value = "";
    const fault = await this.command({ command: "mark", text });
    if (fault) this.input.value = text;
    else this.input.blur();
    this.#say(fault);
  }

  #say(fault) {
    this.answer.dataset.level = fault ? "fault" : "done";
    setText(this.answer, fault ?? "marked");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => setText(this.answer, ""), SHOWN_MS);
  }
}

// Marks: the field that sets a mark (key m) or triggers a snapshot, and the marks in the events, for the plots.

import { h, setText } from "./dom.js";

const LONGEST = 200;
const SHOWN_MS = 4000;
const WHY = "marks and commands need the key of the user who started the daemon; fti page opens this page with it";
const DONE = { mark: "marked", snapshot: "triggered" };

export const marksOf = (events) =>
  events.filter(({ source }) => source === "mark" || source === "trigger").map(({ t_ns: tNs, text }) => ({ t: tNs / 1e9, text }));

export class MarkField {
  // command : sends a command to the daemon, resolves to the reason of a refusal or to null
  constructor(command) {
    this.command = command;
    this.input = h("input", { type: "text", maxlength: LONGEST, placeholder: "mark (press m)", "aria-label": "text of the mark", autocomplete: "off", "data-testid": "mark-text" });
    this.button = h("button", { type: "submit", "data-testid": "mark-button" }, "MARK");
    this.trigger = h("button", { type: "button", class: "trigger", title: "record the data around this moment", "data-testid": "snapshot-button" }, "SNAPSHOT");
    this.viewOnly = h("p", { class: "view-only", title: WHY, "data-testid": "view-only" });
    this.answer = h("output", { "data-testid": "mark-answer" });
    this.root = h("form", { class: "mark" }, this.viewOnly, this.input, this.button, this.trigger, this.answer);
    this.keepsSnapshot = false;
    this.permit("");
    this.root.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send("mark");
    });
    this.trigger.addEventListener("click", () => this.#send("snapshot"));
    this.input.addEventListener("keydown", (event) => event.key === "Escape" && this.input.blur());
    document.addEventListener("keydown", (event) => this.#onKey(event));
  }

  #onKey(event) {
    const typing = event.target.closest?.("input, textarea, select");
    if (event.key !== "m" || typing || this.input.hidden || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.input.focus();
  }

  // fault : why this page may not command, or null
  permit(fault) {
    this.viewOnly.hidden = fault === null;
    setText(this.viewOnly, fault ?? "");
    this.input.hidden = this.button.hidden = fault !== null;
    this.#showTrigger();
  }

  show({ health }) {
    this.keepsSnapshot = Boolean(health?.snapshot);
    this.#showTrigger();
  }

  // The button for a snapshot is shown if the daemon has a snapshot memory.
  #showTrigger() {
    this.trigger.hidden = !this.keepsSnapshot || this.input.hidden;
  }

  // An empty field sets a mark, too: there may be no time to type.
  async #send(command) {
    const text = this.input.value.trim() || command;
    this.input.value = "";
    const fault = await this.command({ command, text });
    if (fault) this.input.value = text;
    else this.input.blur();
    this.#showMessage(fault ?? DONE[command], fault ? "fault" : "done");
  }

  #showMessage(text, level) {
    this.answer.dataset.level = level;
    setText(this.answer, text);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => setText(this.answer, ""), SHOWN_MS);
  }
}

// Marks: the field that sets a mark (key m) or triggers a snapshot, and the marks in the events, for the plots.

import { h, setClass, setText } from "./dom.js";

const LONGEST = 200;
const SHOWN_MS = 4000;
const WHY = "marks and commands need the key of the user who started the daemon; fti page opens this page with it";
const DONE = { mark: "marked", snapshot: "triggered" };

export const marksOf = (events) =>
  events.filter(({ source }) => source === "mark" || source === "trigger").map(({ t_ns: tNs, text }) => ({ t: tNs / 1e9, text }));

export class MarkField {
  // command : sends a command to the daemon, resolves to the reason of a refusal or to null; keys : of the page
  constructor(command, keys) {
    this.command = command;
    this.input = h("input", { type: "text", maxlength: LONGEST, placeholder: "mark (m)", "aria-label": "text of the mark", autocomplete: "off", "data-testid": "mark-text" });
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
    this.root.addEventListener("focusout", ({ relatedTarget }) => this.#settle(relatedTarget));
    keys.add("m", "set a mark: opens its field; Enter sets it", () => this.#call());
  }

  // On a small screen the field comes to the bottom of the window, so that the instruments stay visible.
  #call() {
    if (this.input.hidden) return;
    setClass(this.root, "called", true);
    this.input.focus({ preventScroll: true });
  }

  // It returns to its place when it has neither the focus nor an answer to show.
  #settle(focused) {
    if (!this.answer.textContent && !this.root.contains(focused)) setClass(this.root, "called", false);
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
    this.#showMessage(fault ?? DONE[command], fault ? "fault" : "done");
    if (!fault) this.input.blur();
  }

  #showMessage(text, level) {
    this.answer.dataset.level = level;
    setText(this.answer, text);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      setText(this.answer, "");
      this.#settle(document.activeElement);
    }, SHOWN_MS);
  }
}

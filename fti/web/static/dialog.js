// Modal dialogs: the list of keys, and the question before an action.  Escape closes them.

import { h, setText } from "./dom.js";

export function makeDialog(testid, ...children) {
  const dialog = h("dialog", { "data-testid": testid }, ...children);
  document.body.append(dialog);
  return dialog;
}

// The state that they refer to may have changed.
export function closeDialogs() {
  for (const dialog of document.querySelectorAll("dialog[open]")) dialog.close();
}

export class Question {
  constructor() {
    this.title = h("h2", { "data-testid": "question-title" });
    this.text = h("p", { "data-testid": "question-text" });
    this.no = h("button", { type: "button", autofocus: "", "data-testid": "question-no" }, "CANCEL");
    this.yes = h("button", { type: "button", class: "yes", "data-testid": "question-yes" });
    this.dialog = makeDialog("question", this.title, this.text, h("div", { class: "choices" }, this.no, this.yes));
    this.resolve = null; // of the open question
    this.no.addEventListener("click", () => this.#end(false));
    this.yes.addEventListener("click", () => this.#end(true));
    this.dialog.addEventListener("cancel", () => this.#end(false)); // Escape
    // The event comes after the dialog is closed, maybe when the next question is open.
    this.dialog.addEventListener("close", () => this.dialog.open || this.#end(false));
  }

  // Resolves to true if the operator has agreed.
  ask(title, text, action) {
    setText(this.title, title);
    setText(this.text, text);
    setText(this.yes, action);
    this.dialog.showModal();
    return new Promise((resolve) => {
      this.resolve = resolve;
    });
  }

  withdraw() {
    this.#end(false);
  }

  #end(agreed) {
    const { resolve } = this;
    this.resolve = null;
    this.dialog.close();
    resolve?.(agreed);
  }
}

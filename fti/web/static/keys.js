// Keys of the page, and the list of them (key ?).  They do not act while one types in a field or while a dialog is open.

import { h } from "./dom.js";
import { makeDialog } from "./dialog.js";

const FIELDS = "input, textarea, select";

export class Keys {
  constructor() {
    this.actions = new Map(); // by key
    this.closers = []; // [{root, close}]
    this.list = h("dl", { class: "keys" });
    const close = h("button", { type: "button", "data-testid": "keys-close" }, "CLOSE");
    this.dialog = makeDialog("keys", h("h2", {}, "Keys"), this.list, h("div", { class: "choices" }, close));
    close.addEventListener("click", () => this.dialog.close());
    this.button = h("button", { type: "button", title: "list of the keys (key ?)", "data-testid": "keys-open" }, "? KEYS");
    this.button.addEventListener("click", () => this.#toggleList());
    this.add("?", "show or hide this list", () => this.#toggleList());
    this.#addToList("Esc", "close what is open; leave a field");
    addEventListener("keydown", (event) => this.#onKey(event));
  }

  add(key, meaning, act) {
    this.actions.set(key, act);
    this.#addToList(key, meaning);
  }

  // Escape closes it; from a field, only if the field is in `root`.
  closeOnEscape(root, close) {
    this.closers.push({ root, close });
  }

  #addToList(key, meaning) {
    this.list.append(h("div", {}, h("dt", {}, h("kbd", {}, key)), h("dd", {}, meaning)));
  }

  #toggleList() {
    if (this.dialog.open) this.dialog.close();
    else this.dialog.showModal();
  }

  #onKey(event) {
    const { key, target, repeat, ctrlKey, altKey, metaKey } = event;
    const field = target.closest?.(FIELDS) ?? null;
    if (repeat || ctrlKey || altKey || metaKey || this.#isAsking(key)) return;
    if (key === "Escape") this.#escape(field);
    else if (!field && this.actions.has(key)) {
      event.preventDefault();
      this.actions.get(key)();
    }
  }

  // A dialog handles its keys itself; only ? also closes the list.
  #isAsking(key) {
    return document.querySelector("dialog[open]") !== null && !(this.dialog.open && key === "?");
  }

  #escape(field) {
    field?.blur();
    for (const { root, close } of this.closers) if (field === null || root.contains(field)) close();
  }
}

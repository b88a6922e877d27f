// Commands to devices, if a link may transmit: arguments, send button, and the state of the last ones.
// The open panel replaces the panel of the links.

import { LOST } from "./connection.js";
import { clock, title } from "./format.js";
import { h, panelTitle, setAttribute, setText } from "./dom.js";

const ANSWER_TIMEOUT_MS = 15000; // longer than the timeout of the daemon

export class Commands {
  // links : the panel that this one replaces; command : sends a command to the daemon, resolves to a fault or null; keys : of the page
  constructor(root, links, command, keys) {
    this.root = root;
    this.links = links;
    this.command = command;
    this.devices = [];
    this.pending = null; // number of the open request
    this.fault = ""; // why this page may not command; null when it may
    this.opener = h("button", { type: "button", class: "switch", "data-testid": "commands-open" }, "COMMANDS");
    this.opener.hidden = true;
    const closer = h("button", { type: "button", class: "switch", "data-testid": "commands-close" }, "LINKS");
    links.heading.root.append(this.opener);
    this.opener.addEventListener("click", () => this.#open(true));
    closer.addEventListener("click", () => this.#open(false));
    const heading = panelTitle("Commands", "each is sent once, and recorded").root;
    heading.append(closer);
    this.answers = h("ol", { class: "scroll", "data-testid": "commands-answers" });
    root.append(heading, h("div", { class: "commands" }, this.#makeForm(), this.answers));
    keys.add("c", "open or close the commands to devices, if a link may transmit", () => this.#open(this.root.hidden));
    keys.closeOnEscape(root, () => this.#open(false));
  }

  #makeForm() {
    this.device = h("select", { "aria-label": "device", "data-testid": "commands-device" });
    this.name = h("select", { "aria-label": "command", "data-testid": "commands-name" });
    this.does = h("p", { class: "does", "data-testid": "commands-does" });
    this.args = h("div", { class: "arguments" });
    this.button = h("button", { type: "submit", disabled: "", "data-testid": "commands-send" }, "SEND");
    this.word = h("output", { "data-testid": "commands-word" });
    this.device.addEventListener("change", () => this.#showNames());
    this.name.addEventListener("change", () => this.#showArguments());
    const choice = h("div", { class: "choice" }, this.device, this.name);
    const form = h("form", {}, choice, h("div", { class: "scroll" }, this.does, this.args), h("div", { class: "go" }, this.button, this.word));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send();
    });
    return form;
  }

  #open(open) {
    if (this.opener.hidden || open === !this.root.hidden) return;
    this.root.hidden = !open;
    this.links.root.hidden = open;
    (open ? this.device : this.opener).focus();
  }

  take({ devices, requests }) {
    if (JSON.stringify(devices) !== JSON.stringify(this.devices)) {
      this.devices = devices;
      fillSelect(this.device, devices.map(({ name }) => name));
      this.#showNames();
    }
    this.opener.hidden = devices.length === 0;
    this.answers.replaceChildren(...requests.map(makeAnswer));
    const current = requests.find(({ id }) => id === this.pending);
    if (current) this.#showMessage(current.ended ? current.outcome : `${current.state} …`, current.state);
    if (current?.ended) this.#ready();
  }

  permit(fault) {
    if (fault !== null || this.fault !== null) this.#showMessage(fault ?? "", "");
    this.fault = fault;
    this.#enable();
  }

  #enable() {
    this.button.disabled = this.pending !== null || this.fault !== null;
  }

  #chosen() {
    return this.devices.find(({ name }) => name === this.device.value);
  }

  #showNames() {
    fillSelect(this.name, Object.keys(this.#chosen()?.commands ?? {}));
    this.#showArguments();
  }

  #showArguments() {
    const command = this.#chosen()?.commands[this.name.value];
    setText(this.does, command ? `${command.does}${command.answered ? "" : " (not acknowledged)"}` : "");
    this.args.replaceChildren(...Object.entries(command?.arguments ?? {}).map(makeArgument));
  }

  // One request for each click: the button is disabled until the request has ended.
  async #send() {
    if (this.button.disabled) return;
    const request = makeNumber();
    this.pending = request;
    this.#enable();
    this.timer = setTimeout(() => this.#giveUp(), ANSWER_TIMEOUT_MS);
    this.#showMessage("requested …", "sending");
    const filled = [...this.args.querySelectorAll("input")].filter(({ value }) => value.trim());
    const args = Object.fromEntries(filled.map(({ name, value }) => [name, value.trim()]));
    const fault = await this.command({ command: "send", device: this.device.value, name: this.name.value, args, request });
    if (!fault || this.pending !== request) return;
    if (fault === LOST) {
      this.#showMessage("the connection was lost: the command may have been sent", "unknown"); // updated after a reconnect
    } else {
      this.#showMessage(fault, "not sent");
      this.#ready();
    }
  }

  #giveUp() {
    this.#showMessage("no result from the daemon: see the events", "unknown");
    this.#ready();
  }

  #ready() {
    clearTimeout(this.timer);
    this.pending = null;
    this.#enable();
  }

  #showMessage(text, state) {
    setAttribute(this.word, "data-state", state);
    setAttribute(this.word, "title", text);
    setText(this.word, text);
  }
}

function fillSelect(select, names) {
  const before = select.value;
  select.replaceChildren(...names.map((name) => h("option", { value: name }, title(name))));
  if (names.includes(before)) select.value = before;
}

function makeArgument([name, meaning]) {
  const input = h("input", { type: "text", name, autocomplete: "off", "data-testid": `commands-argument-${name}` });
  return h("label", {}, h("span", {}, title(name)), input, h("small", {}, meaning));
}

function makeAnswer({ t_ns: tNs, title: what, outcome, state, who, data }) {
  const text = h("span", {}, h("b", {}, what), outcome);
  return h("li", { "data-state": state, title: `${who}: ${data}` }, h("time", {}, clock(tNs)), text);
}

export const makeNumber = () => [...crypto.getRandomValues(new Uint32Array(4))].map((part) => part.toString(16)).join("-");

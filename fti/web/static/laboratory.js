// The emulator of the sensors: breakers, active faults, lateness.  Shown while an emulator publishes.

import { age, fixed, isNumber, title } from "./format.js";
import { h, Keyed, panelTitle, setAttribute, setClass, setText } from "./dom.js";
import { Question } from "./dialog.js";
import { makeNumber } from "./commands.js";

const UNIT = "power_unit"; // driver of the device that takes the commands
const PRESS = { on: "off", starting: "off", brown_out: "off", off: "on", tripped: "reset" }; // state to command
const QUESTIONS = {
  off: ["Switch off breaker", "It loses its power and sends nothing until it is switched on again.", "SWITCH OFF"],
  on: ["Switch on breaker", "It gets power and starts; requests and commands sent to it before are lost.", "SWITCH ON"],
  reset: ["Reset tripped breaker", "It gets power and starts; requests and commands sent to it before are lost.", "RESET"],
};
const WORDS = { on: "ON", starting: "STARTS", off: "OFF", tripped: "TRIPPED", brown_out: "LOW V" };
const MAX_LARGE = 9; // devices, with their rates; more are shown on one line each
const ANSWER_TIMEOUT_MS = 15000; // longer than the timeout of the daemon
const MESSAGE_MS = 6000; // how long a refusal is shown

export class Laboratory {
  // command : sends a command to the daemon, resolves to a fault or null
  constructor(root, command) {
    this.root = root;
    this.command = command;
    this.unit = null;
    this.permitted = false;
    this.question = new Question();
    this.asked = null; // {name, command} of the open question
    this.requests = new Map(); // breaker by request number
    const part = (testid, tag = "span") => h(tag, { "data-testid": `laboratory-${testid}` });
    [this.scenario, this.time, this.faults, this.message] = ["scenario", "time", "faults", "said"].map((id) => part(id));
    [this.late, this.supply, this.holds] = ["lateness", "supply", "holds"].map((id) => part(id, "b"));
    this.bar = h("i");
    const { root: heading, side } = panelTitle("Laboratory");
    this.age = side;
    const flight = h("div", { class: "lab-flight" }, heading, this.scenario, h("div", { class: "lab-bar" }, this.bar), this.time);
    const list = h("ul", { class: "breakers" });
    this.breakers = new Keyed(list, (name) => new Breaker(name, () => this.#press(name)));
    const words = h("p", { class: "lab-words" }, this.faults, this.message);
    const figures = h("dl", { class: "lab-figures" }, ...[["late p50 · p99 · max", this.late], ["supply", this.supply], ["rates", this.holds]].map(makeFigure));
    root.append(flight, h("div", { class: "lab-middle" }, list, words), figures);
  }

  take({ devices, requests }) {
    this.unit = devices.find(({ driver }) => driver === UNIT)?.name ?? null;
    for (const { id, ended, state, outcome, args } of requests) {
      if (!ended || !this.requests.delete(id)) continue;
      if (state !== "acknowledged") this.#showMessage(`${title(args.breaker)}: ${outcome}`);
    }
  }

  permit(fault) {
    this.permitted = fault === null;
  }

  show({ hil }) {
    this.root.hidden = !hil;
    if (!hil) return;
    setClass(this.root, "stale", hil.late);
    setText(this.age, hil.late ? `silent for ${age(hil.age_ms)}` : "");
    setText(this.scenario, hil.scenario);
    const { flight_s: now, duration_s: whole } = hil;
    setText(this.time, isNumber(now) ? `${fixed(Math.min(now, whole), 0)} s of ${fixed(whole, 0)} s` : "waiting for the daemon");
    this.bar.style.transform = `scaleX(${Math.min((now ?? 0) / whole, 1).toFixed(4)})`;
    this.#showBreakers(hil);
    this.#showFaults(hil.faults);
    this.#showFigures(hil);
  }

  #showBreakers({ devices, faults, late }) {
    const { asked } = this;
    if (asked && (late || PRESS[devices[asked.name]?.breaker] !== asked.command)) this.question.withdraw();
    const names = Object.keys(devices);
    const items = this.breakers.sync(names);
    setClass(this.root, "many", names.length > MAX_LARGE);
    const waiting = new Set(this.requests.values());
    for (const [name, device] of Object.entries(devices)) {
      items.get(name).show(device, {
        usable: this.permitted && this.unit !== null && !late && !waiting.has(name),
        words: faults.filter(({ on }) => on.includes(name)).map((fault) => fault.words),
      });
    }
  }

  #showFaults(faults) {
    setText(this.faults, faults.length ? faults.map(sentence).join("  ·  ") : "no active fault");
    setAttribute(this.faults, "data-acts", faults.length > 0);
    setAttribute(this.faults, "title", faults.map(sentence).join("\n"));
  }

  #showFigures({ lateness, supply_v: volts, holds, not_held: why }) {
    setText(this.late, `${[lateness.p50_ms, lateness.p99_ms, lateness.max_ms].map((ms) => fixed(ms, 1)).join(" · ")} ms`);
    setText(this.supply, `${fixed(volts, 1)} V`);
    setText(this.holds, holds ? "held" : `${why.length} not held`);
    setAttribute(this.holds, "data-good", holds);
    setAttribute(this.holds, "title", why.join("\n"));
  }

  // The question is withdrawn when the state of the breaker changes meanwhile.
  async #press(name) {
    if (this.asked) return;
    const command = PRESS[this.breakers.items.get(name).state];
    const [what, effect, action] = QUESTIONS[command];
    this.asked = { name, command };
    const agreed = await this.question.ask(`${what} ${title(name)}?`, effect, action);
    this.asked = null;
    if (agreed) await this.#send(name, command);
  }

  // One request for each press: the button is disabled until the request has ended.
  async #send(name, command) {
    const { button } = this.breakers.items.get(name);
    const request = makeNumber();
    this.requests.set(request, name);
    button.disabled = true;
    setTimeout(() => this.requests.delete(request), ANSWER_TIMEOUT_MS);
    const args = { breaker: name };
    const fault = await this.command({ command: "send", device: this.unit, name: command, args, request });
    if (fault && this.requests.delete(request)) this.#showMessage(`${title(name)}: ${fault}`);
  }

  #showMessage(text) {
    clearTimeout(this.timer);
    setText(this.message, text);
    this.timer = setTimeout(() => setText(this.message, ""), MESSAGE_MS);
  }
}

class Breaker {
  constructor(name, press) {
    this.name = name;
    this.button = h("button", { type: "button", "data-testid": `breaker-${name}` });
    this.button.addEventListener("click", press);
    this.note = h("small");
    this.root = h("li", {}, h("b", {}, title(name)), this.note, this.button);
  }

  show({ breaker, asked_hz: rate, messages, link, faults }, { usable, words }) {
    this.state = breaker;
    setAttribute(this.root, "data-state", breaker ?? "none");
    setAttribute(this.root, "data-faulty", faults.some((kind) => kind !== "breaker" && kind !== "brown_out"));
    setText(this.note, words.length ? words.join(", ") : `${fixed(rate, rate % 1 ? 1 : 0)} Hz`);
    setAttribute(this.root, "title", [`${title(this.name)} on ${link}: ${messages} messages sent`, ...words].join("\n"));
    this.button.hidden = breaker === null;
    this.button.disabled = !usable;
    setText(this.button, WORDS[breaker] ?? "");
    setAttribute(this.button, "title", usable ? `press: ${PRESS[breaker]}` : "");
  }
}

const sentence = ({ on, words, until_s: until }) =>
  `${on.length ? `${on.map(title).join(", ")}: ` : ""}${words}${isNumber(until) ? ` until ${fixed(until, 0)} s` : ""}`;

const makeFigure = ([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value));

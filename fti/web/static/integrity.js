// The ground-clearance integrity monitor: state, tests relative to their limits, estimates.

import { fixed, isNumber, plusMinus, UNKNOWN } from "./format.js";
import { h, panelTitle, setAttribute, setClass, setText } from "./dom.js";
import { describe } from "./validity.js";

const TOPIC = "/nav/clearance_integrity";
const FULL_RATIO = 1.5; // end of the bars; the limit (1) is at two thirds
const TESTS = [
  ["t1", "T1", "absolute match"],
  ["t2", "T2", "position shift"],
  ["t3", "T3", "height error"],
  ["t4", "T4", "obstacle"],
];
const WORDS = { no_profile: "NO PROFILE" };

export class Integrity {
  constructor(root) {
    this.word = h("strong", { "data-testid": "integrity-state" }, "NO DATA");
    this.text = h("span", { "data-testid": "integrity-reasons" });
    this.block = h("div", { class: "state-block", "data-state": "none" }, this.word, this.text);
    this.tests = TESTS.map(([id, short, name]) => new Test(id, short, name));
    this.estimates = makeEstimates();
    const bars = h("div", { class: "tests" }, ...this.tests.map((test) => test.root));
    root.append(panelTitle("Clearance integrity").root, this.block, bars, h("dl", { class: "estimates" }, ...this.estimates.map((e) => e.root)));
  }

  show({ outputs }) {
    const output = outputs[TOPIC];
    const { kind, text } = describe(output);
    this.#showState(output, kind, text);
    for (const test of this.tests) test.show(output?.[`${test.id}_ratio`], kind === "stale");
    for (const estimate of this.estimates) estimate.show(output ?? {}, kind === "stale");
  }

  #showState(output, kind, validity) {
    const state = output?.state ?? "none";
    setAttribute(this.block, "data-state", kind === "stale" ? "stale" : state);
    setText(this.word, output ? (WORDS[state] ?? state.toUpperCase()) : "NO DATA");
    setClass(this.word, "struck", kind === "stale");
    const words = output?.reasons_text.join(", ") || output?.state_text || "no output of navigation yet";
    setText(this.text, kind === "stale" ? validity : words);
  }
}

class Test {
  constructor(id, short, name) {
    this.id = id;
    this.bar = h("i");
    this.value = h("b", { "data-testid": id }, UNKNOWN);
    this.root = h(
      "div",
      { class: "test" },
      h("strong", {}, short),
      h("span", {}, name),
      h("div", { class: "bar", role: "img", "aria-label": `${name} over its limit` }, this.bar),
      this.value,
    );
  }

  show(ratio, stale) {
    const share = isNumber(ratio) ? Math.min(ratio / FULL_RATIO, 1) : 0;
    this.bar.style.transform = `scaleX(${share.toFixed(3)})`;
    setAttribute(this.root, "data-level", !isNumber(ratio) ? "none" : ratio > 1 ? "over" : ratio > 0.8 ? "near" : "in");
    setText(this.value, fixed(ratio, 2));
    setClass(this.root, "stale", stale);
    setClass(this.value, "struck", stale && isNumber(ratio));
  }
}

class Estimate {
  constructor(name, testid, unit, read) {
    this.read = read;
    this.value = h("b", { "data-testid": testid }, UNKNOWN);
    this.root = h("div", {}, h("dt", {}, name), h("dd", {}, this.value, h("span", { class: "unit" }, unit)));
  }

  show(output, stale) {
    const text = this.read(output);
    setText(this.value, text);
    setClass(this.value, "struck", stale && text !== UNKNOWN);
  }
}

function makeEstimates() {
  return [
    new Estimate("along-track shift", "shift", "m", (o) => withSd(o.shift, o.shift_sd, 0)),
    new Estimate("height error", "height-error", "m", (o) => withSd(o.height_error, o.height_error_sd, 1)),
    new Estimate("observability", "observability", "", (o) => fixed(o.observability, 1)),
    new Estimate("window", "window", "m", (o) => interval(o.s_begin, o.s_end)),
    new Estimate("protection / alert, along", "alert-s", "m", (o) => levels(o.protection_level_s, o.alert_limit_s, 0)),
    new Estimate("same, vertical", "alert-v", "m", (o) => levels(o.protection_level_v, o.alert_limit_v, 1)),
    new Estimate("reference profile", "reference", "", (o) => o.reference?.slice(0, 8) || UNKNOWN),
  ];
}

function withSd(value, sd, digits) {
  return isNumber(value) ? `${fixed(value, digits, { sign: true })} ${plusMinus(sd, digits)}`.trim() : UNKNOWN;
}

function interval(begin, end) {
  return isNumber(begin) && isNumber(end) ? `${begin.toFixed(0)} … ${end.toFixed(0)}` : UNKNOWN;
}

function levels(protection, alert, digits) {
  return isNumber(alert) ? `${isNumber(protection) ? protection.toFixed(digits) : UNKNOWN} / ${alert.toFixed(digits)}` : UNKNOWN;
}

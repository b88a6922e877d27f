// The glide slope: the needle (the diamond shows the path), the values, the history.

import { degrees, fixed, isNumber, plusMinus, UNKNOWN } from "./format.js";
import { h, panelTitle, setAttribute, setClass, setText, svg } from "./dom.js";
import { marksOf } from "./marks.js";
import { HistoryPlot } from "./plot.js";
import { showValidity } from "./validity.js";

const TOPIC = "/nav/glide_slope";
const DOT = 42; // height of one dot in the drawing
const CENTRE = 110;
const TO_DEGREES = 180 / Math.PI;

export class Glide {
  constructor(root) {
    this.scale = new Scale();
    this.deviation = figure("deviation", "glide-deviation", "°", "large");
    this.dh = figure("height above path", "glide-dh", "m", "large");
    this.distance = figure("to intercept point", "glide-distance", "m");
    this.offset = figure("right of track", "glide-offset", "m");
    this.dhNav = figure("above path, nav", "glide-dh-nav", "m");
    this.words = h("span", { class: "fly", "data-testid": "glide-words" });
    this.validity = h("span", { class: "validity", "data-testid": "glide-validity" });
    this.plotPlace = h("div", { class: "plot", "data-testid": "glide-plot" });
    const figures = [this.deviation, this.dh, this.distance, this.offset, this.dhNav];
    this.values = figures.flatMap((f) => [f.value, f.sd]);
    root.append(
      panelTitle("Glide slope").root,
      h("div", { class: "verdicts" }, this.validity, " ", this.words),
      h("div", { class: "glide-top" }, this.scale.root, h("div", { class: "figures" }, ...figures.map((f) => f.root))),
      this.plotPlace,
    );
    const series = [{ key: `${TOPIC}:deviation`, color: "#e05cff", scale: TO_DEGREES }];
    this.plot = new HistoryPlot(this.plotPlace, { series, digits: 1, range });
  }

  load(history) {
    this.plot.load(history);
  }

  show({ outputs, events, t_ns: tNs }) {
    const output = outputs[TOPIC];
    showValidity(output, this.values, this.validity);
    this.scale.show(output);
    this.#showFigures(output ?? {});
    this.plot.marks = marksOf(events);
    if (tNs) this.plot.add(tNs / 1e9, [output?.valid ? (output.deviation ?? null) : null]);
  }

  #showFigures(output) {
    this.deviation.show(fixed(degrees(output.deviation), 2, { sign: true }), plusMinus(degrees(output.sd), 2));
    this.dh.show(fixed(output.dh, 1, { sign: true }), plusMinus(output.dh_sd, 1));
    this.distance.show(fixed(output.s, 0));
    this.offset.show(fixed(output.y, 0, { sign: true }));
    this.dhNav.show(fixed(output.dh_nav, 1, { sign: true }));
    setText(this.words, output.valid ? wordsOf(output.dots, output.clamped) : "");
  }
}

function wordsOf(dots, clamped) {
  if (!isNumber(dots)) return "";
  const amount = Math.abs(dots).toFixed(1);
  if (amount === "0.0") return "on the path";
  return `${clamped ? "more than " : ""}${amount} dots ${dots > 0 ? "above: fly down" : "below: fly up"}`;
}

function range(min, max) {
  const edge = Math.max(0.4, ...[min, max].filter((v) => v !== null).map((v) => Math.abs(v) * 1.15));
  return [-edge, edge];
}

function figure(label, testid, unit, kind = "") {
  const value = h("b", { "data-testid": testid }, UNKNOWN);
  const sd = h("span", { class: "sd" });
  const root = h("div", { class: `figure ${kind}` }, h("span", { class: "name" }, label), h("div", {}, value, h("span", { class: "unit" }, unit), sd));
  return {
    root,
    value,
    sd,
    show(text, sdText = "") {
      setText(value, text);
      setText(sd, sdText);
    },
  };
}

class Scale {
  constructor() {
    this.needle = svg("path", { class: "needle", d: "M0 -15 L13 0 L0 15 L-13 0 Z", "data-testid": "glide-needle" });
    this.flag = svg("g", { class: "flag" }, svg("rect", { x: 10, y: 92, width: 60, height: 36, rx: 3 }), svg("text", { x: 40, y: 118 }, "GS"));
    const dots = [-2, -1, 1, 2].map((n) => svg("circle", { class: "dot", cx: 40, cy: CENTRE + n * DOT, r: 6 }));
    this.root = svg(
      "svg",
      { class: "glide-scale", viewBox: "0 0 80 220", role: "img", "aria-label": "glide slope needle" },
      svg("rect", { class: "face", x: 1, y: 1, width: 78, height: 218, rx: 8 }),
      ...dots,
      svg("path", { class: "centre", d: `M14 ${CENTRE} H66` }),
      this.needle,
      this.flag,
    );
  }

  // Above the path (dots > 0) the diamond moves down.
  show(output) {
    const usable = output?.valid && isNumber(output.dots);
    if (usable) setAttribute(this.needle, "transform", `translate(40 ${(CENTRE + output.dots * DOT).toFixed(1)})`);
    setClass(this.root, "unusable", !usable);
  }
}

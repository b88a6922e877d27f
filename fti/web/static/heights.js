// The height above the ground below the aircraft (large); the height and the raw range of each altimeter (smaller);
// and their history.

import { fixed, isNumber, plusMinus, title } from "./format.js";
import { h, Keyed, panelTitle, setAttribute, setClass, setText, svg } from "./dom.js";
import { marksOf } from "./marks.js";
import { HistoryPlot } from "./plot.js";
import { showValidity } from "./validity.js";

const PREFIX = "/nav/height_above_ground/";
const BELOW = "/nav/height_below_aircraft";
const SOLUTION = "/nav/nav_solution";
// Lines of the altimeters: their dashes differ as their colours do.  The first is broad, so that it stays visible below the
// others; the dots of the raw ranges are as broad as their line and wider apart with each altimeter.
const LINES = [
  { color: "#4cc9f0", width: 4, dash: [] },
  { color: "#f0a6ff", width: 2, dash: [12, 5] },
  { color: "#ffd23f", width: 2, dash: [12, 4, 2, 4] },
  { color: "#7ae582", width: 2, dash: [5, 4] },
];

const lineOf = (place) => LINES[place % LINES.length];
const rawLineOf = (place) => ({ color: lineOf(place).color, width: 1.5, dash: [1.5, 4 + 4 * (place % LINES.length)] });

export const seriesOf = (topics) =>
  topics.flatMap((topic, place) => [
    { key: `${topic}:raw`, ...rawLineOf(place) },
    { key: `${topic}:height_agl`, ...lineOf(place) },
  ]);

export class Heights {
  constructor(root) {
    this.list = h("div", { class: "sensors" });
    this.plotPlace = h("div", { class: "plot", "data-testid": "heights-plot" });
    const { root: heading } = panelTitle("Height above ground");
    this.below = new Below();
    root.append(heading, this.below.root, this.list, this.plotPlace);
    this.rows = new Keyed(this.list, (topic) => new Sensor(topic));
    this.topics = [];
    this.history = null;
  }

  load(history) {
    this.history = history;
    this.plot?.load(history);
  }

  show({ outputs, events, t_ns: tNs }) {
    const topics = Object.keys(outputs).filter((topic) => topic.startsWith(PREFIX));
    if (topics.join() !== this.topics.join()) this.#arrange(topics);
    this.below.show(outputs[BELOW], outputs[SOLUTION]);
    const rows = this.rows.sync(topics);
    topics.forEach((topic, place) => rows.get(topic).show(outputs[topic], place));
    if (this.plot) this.plot.marks = marksOf(events);
    if (this.plot && tNs) this.plot.add(tNs / 1e9, topics.flatMap((topic) => plotted(outputs[topic])));
  }

  #arrange(topics) {
    this.topics = topics;
    this.list.dataset.count = topics.length;
    if (this.plot) this.history = this.plot.close();
    this.plot = new HistoryPlot(this.plotPlace, { series: seriesOf(topics), digits: 0, range });
    if (this.history) this.plot.load(this.history);
  }
}

function range(min, max) {
  if (min === null) return [0, 100];
  const margin = Math.max(2, (max - min) * 0.08);
  return [Math.max(0, min - margin), max + margin];
}

function plotted(output) {
  return [output.late ? null : output.raw, output.valid ? output.height_agl : null];
}

// The nearest return and the range predicted from terrain, or why it is unknown.
function overGround(output) {
  if (!isNumber(output.nearest)) return uncheckedOf(output);
  const predicted = isNumber(output.predicted) ? `, predicted ${fixed(output.predicted, 1)}` : "";
  return `nearest ${fixed(output.nearest, 1)} ${plusMinus(output.nearest_sd, 1)}${predicted}`;
}

function uncheckedOf(output) {
  return (output.unchecked_text ?? []).join(", ");
}

// Legend: a piece of a line of the plot.
class LineSample {
  constructor(testid) {
    this.path = svg("path", { d: "M0 4 H30" });
    this.root = svg("svg", { class: "line-sample", viewBox: "0 0 30 8", "aria-hidden": "true", "data-testid": testid }, this.path);
  }

  show({ color, width, dash }) {
    setAttribute(this.path, "stroke", color);
    setAttribute(this.path, "stroke-width", width);
    setAttribute(this.path, "stroke-dasharray", dash.join(" ") || "none");
  }
}

class Below {
  constructor() {
    this.value = h("b", { "data-testid": "height-below" }, "–");
    this.sd = h("span", { class: "sd", "data-testid": "height-below-sd" });
    this.level = h("span", { class: "level", "data-testid": "height-below-vpl" });
    this.source = h("span", { class: "remark", "data-testid": "height-below-source" });
    this.validity = h("span", { class: "validity", "data-testid": "height-below-validity" });
    this.root = h(
      "div",
      { class: "below" },
      h("div", { class: "label" }, h("strong", {}, "Below the aircraft"), this.source, this.validity),
      h("div", { class: "big" }, h("span", {}, this.value, h("span", { class: "unit" }, "m")), h("span", { class: "bounds" }, this.sd, this.level)),
    );
  }

  show(output, solution) {
    this.root.hidden = output === undefined;
    if (output === undefined) return;
    this.#showLevel(solution ?? {});
    setText(this.value, fixed(output.height_agl, 1));
    setText(this.sd, plusMinus(output.sd, 1));
    setText(this.source, output.valid ? `by ${title(output.sensor)}` : "");
    showValidity(output, [this.value, this.sd], this.validity);
  }

  // Protection level of the altitude above the ellipsoid, which is compared with the terrain.
  #showLevel({ vpl, late, unchecked_text: unchecked = [] }) {
    const known = isNumber(vpl) && !late;
    setText(this.level, known ? `alt VPL ${vpl.toFixed(0)} m` : "");
    setClass(this.level, "unchecked", known && unchecked.length > 0);
    setAttribute(this.level, "title", ["vertical protection level of the altitude", ...unchecked].join("; "));
  }
}

class Sensor {
  constructor(topic) {
    const name = topic.slice(PREFIX.length);
    const id = `height-${name}`;
    this.line = new LineSample(`${id}-line`);
    this.rawLine = new LineSample(`${id}-raw-line`);
    this.value = h("b", { "data-testid": `${id}-agl` }, "–");
    this.sd = h("span", { class: "sd" });
    this.raw = h("b", { "data-testid": `${id}-raw` }, "–");
    this.ground = h("span", { class: "ground", title: "nearest return, and the range predicted from terrain [m]", "data-testid": `${id}-ground` });
    this.remark = h("span", { class: "remark", "data-testid": `${id}-remark` });
    this.validity = h("span", { class: "validity", "data-testid": `${id}-validity` });
    this.root = h(
      "div",
      { class: "sensor", "data-testid": id },
      h("div", { class: "label" }, h("strong", {}, this.line.root, title(name)), this.validity),
      h("div", { class: "big" }, this.value, h("span", { class: "unit" }, "m"), this.sd),
      h("div", { class: "raw" }, this.rawLine.root, h("span", {}, "raw"), this.raw, h("span", { class: "unit" }, "m")),
      this.ground,
      this.remark,
    );
  }

  show(output, place) {
    this.line.show(lineOf(place));
    this.rawLine.show(rawLineOf(place));
    setText(this.value, fixed(output.height_agl, 1));
    setText(this.sd, plusMinus(output.sd, 1));
    setText(this.raw, fixed(output.raw, 1));
    setText(this.ground, overGround(output));
    setText(this.remark, output.valid && isNumber(output.predicted) ? uncheckedOf(output) : "");
    showValidity(output, [this.value, this.sd, this.raw], this.validity);
  }
}

// A history plot: the last two minutes on one time axis, with gaps at invalid values, and with the marks.

import uPlot from "./vendor/uplot-1.6.32/uPlot.esm.js";
import { clock, fixed } from "./format.js";

const PERIOD_S = 0.19; // states come at 10 Hz, not to the millisecond: every second one
const GAP_S = 1.0;
const SPAN_S = 120;
const MARK_COLOUR = "#e8eef4";
const LONGEST_LABEL = 18;
const LANES = 3; // of labels, chosen by the second of the mark, so that none jumps
const FONT_PX = 14;
const FONT = `${FONT_PX}px B612`;
const AXIS = { stroke: "#8fa1b3", font: FONT, grid: { stroke: "#1d2936", width: 1 }, ticks: { show: false } };

export class HistoryPlot {
  // series : [{key, color, dash?, width?, scale?}], scale : factor on the values; range : (min, max) => [min, max]
  constructor(parent, { series, range, digits }) {
    this.series = series;
    this.data = [[], ...series.map(() => [])];
    this.marks = []; // [{t, text}]
    this.plot = new uPlot(this.#options(range, digits), this.data, parent);
    this.observer = new ResizeObserver(() => this.#fit(parent));
    this.observer.observe(parent);
  }

  #options(range, digits) {
    return {
      width: 100,
      height: 100,
      legend: { show: false },
      cursor: { show: false },
      hooks: { draw: [(plot) => drawMarks(plot, this.marks)] },
      padding: [8, 34, 0, 0],
      scales: { x: { time: false, auto: false }, y: { range: (_, min, max) => range(min, max) } },
      axes: [
        { ...AXIS, size: 26, gap: 8, space: 80, incrs: [30, 60, 120], values: (_, splits) => splits.map((t) => clock(t * 1e9)) },
        { ...AXIS, size: 48, gap: 4, space: 28, values: (_, splits) => splits.map((v) => fixed(v, digits)) },
      ],
      series: [{}, ...this.series.map(lineOf)],
    };
  }

  // The time axis also moves without valid values.
  #draw() {
    const end = this.data[0].at(-1) ?? 0;
    this.plot.batch(() => {
      this.plot.setData(this.data, false);
      this.plot.setScale("x", { min: end - SPAN_S, max: end });
    });
  }

  #fit(parent) {
    const { clientWidth: width, clientHeight: height } = parent;
    if (width > 0 && height > 0) this.plot.setSize({ width, height });
  }

  load(history) {
    this.data = [
      [...history.t], // copied: several plots share the history
      ...this.series.map(({ key, scale = 1 }) => history.t.map((_, i) => scaled(history.series[key]?.[i], scale))),
    ];
    this.#draw();
  }

  // Adds a row; values in the order of the series, null if missing.
  add(t, values) {
    const times = this.data[0];
    const last = times.at(-1) ?? -Infinity;
    if (t - last < PERIOD_S) return;
    if (times.length && t - last > GAP_S) this.#push(last + PERIOD_S, values.map(() => null));
    this.#push(t, values);
    while (times[0] < t - SPAN_S) this.data.forEach((column) => column.shift());
    this.#draw();
  }

  #push(t, values) {
    this.data[0].push(t);
    values.forEach((value, i) => this.data[i + 1].push(scaled(value, this.series[i].scale ?? 1)));
  }

  // Ends the plot and returns its history for its replacement.
  close() {
    this.observer.disconnect();
    this.plot.destroy();
    const [t, ...columns] = this.data;
    const unscaled = this.series.map(({ key, scale = 1 }, i) => [key, columns[i].map((v) => scaled(v, 1 / scale))]);
    return { t, series: Object.fromEntries(unscaled) };
  }
}

// A dashed line for each mark, its text beside it.
function drawMarks(plot, marks) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.font = `${FONT_PX * devicePixelRatio}px B612`;
  ctx.strokeStyle = ctx.fillStyle = MARK_COLOUR;
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash([5 * devicePixelRatio, 3 * devicePixelRatio]);
  for (const { t, text } of marks) {
    if (t < plot.scales.x.min || t > plot.scales.x.max) continue;
    const x = Math.round(plot.valToPos(t, "x", true)) + (ctx.lineWidth % 2) / 2; // on whole pixels
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    const label = text.length > LONGEST_LABEL ? `${text.slice(0, LONGEST_LABEL - 1)}…` : text;
    const right = x + ctx.measureText(label).width + 6 * devicePixelRatio < bbox.left + bbox.width;
    ctx.textAlign = right ? "left" : "right";
    ctx.fillText(label, x + (right ? 4 : -4) * devicePixelRatio, bbox.top + (14 + 17 * (Math.floor(t) % LANES)) * devicePixelRatio);
  }
  ctx.restore();
}

function lineOf({ color, dash, width = 2 }) {
  return { stroke: color, width, dash, points: { show: false }, spanGaps: false };
}

function scaled(value, factor) {
  return value === null || value === undefined ? null : value * factor;
}

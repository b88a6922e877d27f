// The artificial horizon with the heading, and the position in use.

import { Fallbacks } from "./fallbacks.js";
import { degrees, fixed, isNumber, latLon, plusMinus, UNKNOWN } from "./format.js";
import { h, panelTitle, setAttribute, setClass, setText, svg } from "./dom.js";
import { showValidity } from "./validity.js";

const TOPIC = "/nav/nav_solution";
// Sources that are not devices.
const NO_DEVICE = ["filter", "radio", "vertical"];
const PER_DEGREE = 5.2; // drawing units
const HEIGHT = 270; // of the drawing; its width follows the place
const TEXT_PX = 14; // of the numbers, whatever the size of the drawing
const HEADING_STEP = 5; // [px] per degree
const TAPE_PX = 26; // height of the heading tape
const KNOT = 1852 / 3600;
const FOOT = 0.3048;

export class Attitude {
  constructor(root) {
    this.horizon = new Horizon();
    this.validity = h("span", { class: "validity", "data-testid": "attitude-validity" });
    this.cells = Object.fromEntries(CELLS.map(([name, label, unit]) => [name, makeCell(name, label, unit)]));
    const { root: heading, side } = panelTitle("Attitude and position");
    this.sources = side;
    setAttribute(side, "data-testid", "attitude-sources");
    this.fallbacks = new Fallbacks();
    this.values = Object.values(this.cells).map((cell) => cell.value);
    const list = (kind, names) => h("dl", { class: `cells ${kind}` }, ...names.map((name) => this.cells[name].root));
    setAttribute(this.cells.alt.root, "title", "above the ellipsoid WGS84, and one sigma");
    this.state = h("span", { class: "state", "data-testid": "attitude-state" });
    root.append(
      heading,
      h("div", { class: "verdicts" }, this.validity, " ", this.state),
      h("div", { class: "picture" }, this.horizon.root),
      list("motion", ["roll", "pitch", "heading", "speed", "climb", "alt"]),
      list("position", ["lat", "lon"]),
      this.fallbacks.root,
    );
  }

  show({ outputs }) {
    const output = outputs[TOPIC];
    showValidity(output, [], this.validity);
    for (const value of this.values) setClass(value, "struck", Boolean(output?.late)); // a missing value is a dash
    this.horizon.show(output);
    this.#showState(output);
    for (const [name, text] of Object.entries(read(output ?? {}))) setText(this.cells[name].value, text);
    setText(this.cells.alt.sd, plusMinus(output?.vertical_sd, 1));
    setText(this.cells.lat.sd, metres(output?.horizontal_sd));
    this.showLevels(output ?? {});
    setText(this.sources, sourcesOf(output ?? {}));
    setClass(this.sources, "no-device", NO_DEVICE.some((name) => [output?.position_source, output?.attitude_source, output?.altitude_source].includes(name)));
    this.fallbacks.show(outputs);
  }

  // Protection levels; coloured if they depend on the stated accuracy of a source; the reasons are in the title.
  showLevels({ hpl, vpl, unchecked_text: unchecked = [], tilt_pl: tilt, heading_pl: heading, attitude_unchecked_text: alone = [] }) {
    this.#showLevel("lon", [level("HPL", hpl), level("VPL", vpl)].filter(Boolean).join(" · "), [LEVELS, ...unchecked]);
    for (const name of ["roll", "pitch"]) this.#showLevel(name, angle(tilt), [TILT_LEVEL, ...alone]);
    this.#showLevel("heading", angle(heading), [HEADING_LEVEL]);
  }

  #showState(output) {
    const { text, kind, why } = stateOf(output);
    setText(this.state, text);
    setAttribute(this.state, "data-kind", kind);
    setAttribute(this.state, "title", why.join(", "));
  }

  #showLevel(name, text, [what, ...unchecked]) {
    const { sd, root } = this.cells[name];
    setText(sd, text);
    setClass(sd, "unchecked", text !== "" && unchecked.length > 0);
    setAttribute(root, "title", [what, ...unchecked].join("; "));
  }
}

// Only of the attitude.
function stateOf(output) {
  if (!output || output.late || output.attitude_valid === undefined) return { text: "", kind: "none", why: [] };
  if (!output.attitude_valid) return { text: "ATT NOT VALID", kind: "invalid", why: output.attitude_reasons_text };
  const why = output.attitude_unchecked_text;
  return why.length ? { text: "ATT UNCHECKED", kind: "unchecked", why } : { text: "ATT VALID", kind: "valid", why };
}

const metres = (sd) => (isNumber(sd) ? `± ${sd.toFixed(sd < 10 ? 1 : 0)} m` : "");

const LEVELS = "horizontal and vertical protection level [m]: the error exceeds it with a probability below 0.001, even with a faulty source";
const TILT_LEVEL = "protection level of roll and pitch together [deg]";
const HEADING_LEVEL = "protection level of the heading [deg]";
const angle = (pl) => (isNumber(pl) ? `PL ${degrees(pl).toFixed(degrees(pl) < 10 ? 1 : 0)}` : "");
const level = (name, value) => (isNumber(value) ? `${name} ${value.toFixed(0)}` : "");

// One name if all values are from one source, otherwise the source of each.
function sourcesOf({ attitude_source: attitude, position_source: position, altitude_source: altitude }) {
  if (position && attitude === position && (altitude ?? position) === position) return position;
  const parts = [["pos", position], ["alt", altitude === position ? null : altitude], ["att", attitude]];
  return parts.filter(([, name]) => name).map(([what, name]) => `${what} ${name}`).join(" · ");
}

const CELLS = [
  ["roll", "roll", "°"],
  ["pitch", "pitch", "°"],
  ["heading", "hdg", "°"],
  ["speed", "GS", "kt"],
  ["climb", "VS", "fpm"],
  ["alt", "alt", "m"],
  ["lat", "lat", ""],
  ["lon", "lon", ""],
];

function makeCell(name, label, unit) {
  const value = h("b", { "data-testid": `attitude-${name}` }, UNKNOWN);
  const sd = h("span", { class: "sd", "data-testid": `attitude-${name}-sd` });
  return { root: h("div", { class: name }, h("dt", {}, label), h("dd", {}, value, h("span", { class: "unit" }, unit)), sd), value, sd };
}

function read(output) {
  const { vel_north: north, vel_east: east, vel_down: down } = output;
  const speed = isNumber(north) && isNumber(east) ? Math.hypot(north, east) / KNOT : null;
  const [lat, lon] = latLon(output.lat, output.lon);
  return {
    roll: fixed(degrees(output.roll), 1, { sign: true }),
    pitch: fixed(degrees(output.pitch), 1, { sign: true }),
    heading: fixed(degrees(output.heading), 1).padStart(5, "0").replace(/^0+–$/, UNKNOWN),
    speed: fixed(speed, 0),
    climb: fixed(isNumber(down) ? (-down / FOOT) * 60 : null, 0, { sign: true }),
    alt: fixed(output.alt, 1),
    lat,
    lon,
  };
}

class Horizon {
  constructor() {
    this.world = svg("g", {}, ...makeWorld());
    this.ladder = svg("g", { class: "ladder" }, ...makeLadder());
    this.bankMark = svg("path", { class: "bank-mark", d: "M0 -112 l-8 14 h16 Z" });
    this.tape = svg("g", { class: "tape" }, ...makeTape());
    this.window = svg("rect", { x: -150, y: -82, width: 300 }); // of the ladder: between bank scale and tape
    // The tape is drawn in pixels, from the middle of the lower edge.
    this.foot = svg(
      "g",
      {},
      svg("rect", { class: "tape-face", x: -2000, y: -TAPE_PX, width: 4000, height: TAPE_PX }),
      this.tape,
      svg("path", { class: "lubber", d: `M0 ${-TAPE_PX + 4} l-7 -11 h14 Z` }),
    );
    this.root = svg(
      "svg",
      { class: "horizon", role: "img", "aria-label": "artificial horizon" },
      svg("defs", {}, svg("clipPath", { id: "ladder-clip" }, this.window)),
      svg("g", {}, this.world, svg("g", { class: "bank-scale" }, ...makeBankScale()), this.bankMark),
      svg("g", { class: "rungs", "clip-path": "url(#ladder-clip)" }, this.ladder),
      svg("path", { class: "aircraft", d: "M-78 0 h42 v9 M78 0 h-42 v9 M-4 -4 h8 v8 h-8 Z" }),
      this.foot,
      svg("g", { class: "flag" }, svg("path", { d: "M-150 -135 L150 135 M150 -135 L-150 135" }), svg("rect", { x: -46, y: -22, width: 92, height: 44, rx: 3 }), svg("text", { y: 11 }, "ATT")),
    );
    new ResizeObserver(([{ contentRect }]) => this.#fit(contentRect)).observe(this.root);
  }

  #fit({ width, height }) {
    if (!height) return;
    const pixel = HEIGHT / height; // in units of the drawing
    setAttribute(this.root, "viewBox", `${(-width / 2) * pixel} ${-HEIGHT / 2} ${width * pixel} ${HEIGHT}`);
    setAttribute(this.foot, "transform", `translate(0 ${HEIGHT / 2}) scale(${pixel})`);
    setAttribute(this.window, "height", 82 + HEIGHT / 2 - (TAPE_PX + 8) * pixel);
    this.root.style.setProperty("--text", `${TEXT_PX * pixel}px`);
  }

  show(output) {
    const roll = degrees(output?.roll);
    const pitch = degrees(output?.pitch);
    const heading = degrees(output?.heading);
    const turn = `rotate(${(-(roll ?? 0)).toFixed(2)})`;
    const turnAndShift = `${turn} translate(0 ${((pitch ?? 0) * PER_DEGREE).toFixed(2)})`;
    setAttribute(this.world, "transform", turnAndShift);
    setAttribute(this.ladder, "transform", turnAndShift);
    setAttribute(this.bankMark, "transform", turn);
    setAttribute(this.tape, "transform", `translate(${(-(heading ?? 0) * HEADING_STEP).toFixed(1)} 0)`);
    setClass(this.root, "unusable", !output || output.late || roll === null || pitch === null);
    setClass(this.root, "no-heading", heading === null);
  }
}

function makeWorld() {
  return [
    svg("rect", { class: "sky", x: -900, y: -900, width: 1800, height: 900 }),
    svg("rect", { class: "ground", x: -900, y: 0, width: 1800, height: 900 }),
    svg("path", { class: "horizon-line", d: "M-900 0 H900" }),
  ];
}

function makeLadder() {
  const parts = [];
  for (let angle = -60; angle <= 60; angle += 5) {
    if (angle === 0) continue;
    const y = -angle * PER_DEGREE;
    const half = angle % 10 === 0 ? 34 : 17;
    parts.push(svg("path", { class: "rung", d: `M${-half} ${y} H${half}` }));
    if (angle % 10 === 0) for (const side of [-1, 1]) parts.push(svg("text", { class: side < 0 ? "left" : "", x: side * 39, y }, String(Math.abs(angle))));
  }
  return parts;
}

function makeBankScale() {
  return [-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60].map((angle) =>
    svg("path", { d: `M0 -114 v${angle % 30 === 0 ? -13 : -7}`, transform: `rotate(${angle})` }),
  );
}

function makeTape() {
  const parts = [];
  for (let angle = -60; angle <= 420; angle += 5) {
    const x = angle * HEADING_STEP;
    parts.push(svg("path", { d: `M${x} ${-TAPE_PX} v${angle % 10 === 0 ? 6 : 4}` }));
    if (angle % 10 === 0) parts.push(svg("text", { x, y: -5 }, nameOf((angle + 360) % 360)));
  }
  return parts;
}

function nameOf(angle) {
  return { 0: "N", 90: "E", 180: "S", 270: "W" }[angle] ?? String(angle).padStart(3, "0");
}

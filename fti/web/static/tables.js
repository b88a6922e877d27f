// Tables of links and devices, each with a state as colour and text.

import { age, bytes, fixed, isNumber, title } from "./format.js";
import { ClockRow } from "./clocks.js";
import { h, Keyed, panelTitle, setAttribute, setText } from "./dom.js";

const BUFFERS = ["receive", "global", "write"];
const LINK_COLUMNS = ["link", "state", "frames/s", "bytes", "age", "R G W", "dropped", "sent"];
const DEVICE_COLUMNS = ["device", "state", "rate", "age", "skipped"];
const LEFT = ["link", "device", "program", "state", "R G W"];

export class Table {
  constructor(root, heading, columns, make) {
    this.root = root;
    this.heading = panelTitle(heading);
    const head = h("tr", {}, ...columns.map((text) => h("th", { class: LEFT.includes(text) ? "" : "number" }, text)));
    const table = h("table", {}, h("thead", {}, head));
    root.append(this.heading.root, h("div", { class: "scroll" }, table));
    this.rows = new Keyed(table, make, 1);
  }

  showRows(table, silence) {
    const rows = this.rows.sync(Object.keys(table));
    for (const [name, fields] of Object.entries(table)) rows.get(name).show(fields, silence);
  }
}

export class Links extends Table {
  constructor(root) {
    super(root, "Links", LINK_COLUMNS, (name) => new LinkRow(name));
  }

  show({ health, health_age_ms: silence }) {
    this.showRows(health?.links ?? {}, silence);
    if (!health) return;
    const total = Object.values(health.links).reduce((sum, link) => sum + link.bytes, 0);
    setText(this.heading.side, `${bytes(total)} received`);
  }
}

export class Devices extends Table {
  constructor(root) {
    super(root, "Devices", DEVICE_COLUMNS, (name) => new DeviceRow(name));
  }

  show({ health, health_age_ms: silence }) {
    this.showRows(health?.devices ?? {}, silence);
    const navigation = health?.navigation;
    if (!navigation) return;
    const { lag_ms: lag, output_delay: delay, ring_lost_frames: lost } = navigation;
    const out = delay ? `outputs ${fixed(delay.p50_ms, 0)}, p99 ${fixed(delay.p99_ms, 0)} ms · ` : "";
    setText(this.heading.side, `${out}${fixed(lag, 0)} ms behind · ring lost ${lost}`);
    setAttribute(this.heading.side, "title", "latency from a frame's timestamp to its output; lag of navigation");
  }
}

// Name, state and cells of a link, device or sink; its hint is below while its state is not good.
export class Row {
  constructor(kind, name, cells) {
    this.state = h("span", { class: "pill", "data-testid": `${kind}-${name}-state` });
    this.kind = h("span");
    this.hint = h("td", { colspan: cells.length + 2, "data-testid": `${kind}-${name}-hint` });
    this.hintRow = h("tr", { class: "hint" }, this.hint);
    const label = h("td", { class: "name" }, h("b", {}, title(name)), this.kind);
    const line = h("tr", {}, label, h("td", {}, this.state), ...cells);
    this.root = h("tbody", { "data-testid": `${kind}-${name}` }, line, this.hintRow);
  }

  showState({ state, hint }, kind) {
    setText(this.state, state);
    setAttribute(this.state, "data-state", state.replace(" ", "_"));
    setText(this.kind, kind);
    setText(this.hint, hint ?? "");
    this.hintRow.hidden = !hint || state === "good";
  }
}

class LinkRow extends Row {
  constructor(name) {
    const [rate, size, aged, dropped, sent] = Array.from({ length: 5 }, numberCell);
    const bars = BUFFERS.map(() => h("i"));
    const loads = h("td", {}, h("div", { class: "loads" }, ...bars.map((bar) => h("div", {}, bar))));
    super("link", name, [rate, size, aged, loads, dropped, sent]);
    Object.assign(this, { rate, size, aged, dropped, sent, bars });
  }

  show(link, silence) {
    this.showState(link, link.kind);
    setText(this.rate, fixed(link.rate_hz, 1));
    setText(this.size, bytes(link.bytes));
    setText(this.aged, grown(link.age_ms, silence));
    BUFFERS.forEach((name, i) => showLoad(this.bars[i], name, link.load?.[name] ?? 0));
    showCount(this.dropped, String(link.dropped_frames), `${bytes(link.dropped_bytes)} dropped`);
    setText(this.sent, String(link.tx_frames));
  }
}

class DeviceRow extends Row {
  constructor(name) {
    const [rate, aged, skipped] = Array.from({ length: 3 }, numberCell);
    super("device", name, [rate, aged, skipped]);
    const clocks = new Keyed(this.root, (scale) => new ClockRow(name, scale, DEVICE_COLUMNS.length), 1);
    Object.assign(this, { rate, aged, skipped, clocks });
  }

  show(device, silence) {
    this.showState(device, device.driver);
    setText(this.rate, isNumber(device.rate_hz) ? `${fixed(device.rate_hz, 1)} Hz` : fixed(null));
    setText(this.aged, grown(device.age_ms, silence));
    const skipped = Object.entries(device.skipped ?? {});
    const total = skipped.reduce((sum, [, count]) => sum + count, 0);
    const reasons = skipped.map(([reason, count]) => `${title(reason)}: ${count} bytes`).join("\n");
    showCount(this.skipped, total ? bytes(total) : "0", reasons);
    const clocks = device.clocks ?? [];
    const rows = this.clocks.sync(clocks.map((clock) => clock.scale));
    for (const clock of clocks) rows.get(clock.scale).show(clock);
  }
}

export const numberCell = () => h("td", { class: "number" });

const grown = (milliseconds, silence) => age(isNumber(milliseconds) ? milliseconds + silence : null);

export function showCount(place, text, detail) {
  setText(place, text);
  setAttribute(place, "data-bad", text !== "0");
  setAttribute(place, "title", detail);
}

function showLoad(bar, name, load) {
  bar.style.transform = `scaleY(${Math.min(load, 1).toFixed(3)})`;
  setAttribute(bar.parentElement, "title", `${name} buffer ${(load * 100).toFixed(0)} %`);
  setAttribute(bar, "data-level", load >= 0.9 ? "full" : load >= 0.5 ? "high" : "low");
}

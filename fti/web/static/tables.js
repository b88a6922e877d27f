// What is plugged in (links) and what is understood (devices), each with one state, in a colour and in words.

import { age, bytes, fixed, isNumber, title } from "./format.js";
import { h, Keyed, panelTitle, setAttribute, setText } from "./dom.js";

const BUFFERS = ["receive", "global", "write"];

class Table {
  constructor(root, heading, note, columns, make) {
    this.heading = panelTitle(heading, note);
    const body = h("tbody");
    const head = h("tr", {}, ...columns.map(([text, kind]) => h("th", kind ? { class: kind } : {}, text)));
    root.append(this.heading.root, h("div", { class: "scroll" }, h("table", {}, h("thead", {}, head), body)));
    this.rows = new Keyed(body, make);
  }

  showRows(table, silence) {
    const names = Object.keys(table);
    const rows = this.rows.sync(names);
    for (const name of names) rows.get(name).show(table[name], silence);
  }
}

export class Links extends Table {
  constructor(root) {
    const columns = [["link"], ["state"], ["hint", "wide"], ["frames/s", "number"], ["bytes", "number"], ["age", "number"], ["buffers R G W"], ["dropped", "number"], ["sent", "number"]];
    super(root, "Links", "", columns, (name) => new LinkRow(name));
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
    const columns = [["device"], ["state"], ["driver · hint", "wide"], ["rate", "number"], ["age", "number"], ["skipped", "number"]];
    super(root, "Devices", "", columns, (name) => new DeviceRow(name));
  }

  show({ health, health_age_ms: silence }) {
    this.showRows(health?.devices ?? {}, silence);
    const navigation = health?.navigation;
    if (navigation) setText(this.heading.side, `navigation ${fixed(navigation.lag_ms, 0)} ms behind · ring lost ${navigation.ring_lost_frames}`);
  }
}

function cell(kind = "") {
  return h("td", kind ? { class: kind } : {});
}

function showState(place, state) {
  setText(place, state);
  setAttribute(place, "data-state", state.replace(" ", "_"));
}

function showHint(place, text) {
  setText(place, text);
  setAttribute(place, "title", text);
}

function showCount(place, text, bad) {
  setText(place, text);
  setAttribute(place, "data-bad", Boolean(bad));
}

class LinkRow {
  constructor(name) {
    this.name = h("td", { class: "name" }, title(name));
    this.state = h("span", { class: "pill", "data-testid": `link-${name}-state` });
    this.hint = cell("hint");
    this.numbers = ["rate", "bytes", "age"].map(() => cell("number"));
    this.bars = BUFFERS.map(() => h("i"));
    this.dropped = cell("number");
    this.sent = cell("number");
    const buffers = h("td", {}, h("div", { class: "loads" }, ...this.bars.map((bar) => h("div", {}, bar))));
    this.root = h("tr", { "data-testid": `link-${name}` }, this.name, h("td", {}, this.state), this.hint, ...this.numbers, buffers, this.dropped, this.sent);
  }

  show(link, silence) {
    showState(this.state, link.state);
    showHint(this.hint, link.hint || link.kind);
    const texts = [fixed(link.rate_hz, 1), bytes(link.bytes), age(isNumber(link.age_ms) ? link.age_ms + silence : null)];
    texts.forEach((text, i) => setText(this.numbers[i], text));
    BUFFERS.forEach((name, i) => this.#showLoad(this.bars[i], name, link.load?.[name] ?? 0));
    const { dropped_frames: dropped } = link;
    showCount(this.dropped, dropped ? `${dropped} (${bytes(link.dropped_bytes)})` : "0", dropped);
    setText(this.sent, String(link.tx_frames));
  }

  #showLoad(bar, name, load) {
    bar.style.transform = `scaleY(${Math.min(load, 1).toFixed(3)})`;
    setAttribute(bar.parentElement, "title", `${name} buffer ${(load * 100).toFixed(0)} %`);
    setAttribute(bar, "data-level", load >= 0.9 ? "full" : load >= 0.5 ? "high" : "low");
  }
}

class DeviceRow {
  constructor(name) {
    this.name = h("td", { class: "name" }, title(name));
    this.state = h("span", { class: "pill", "data-testid": `device-${name}-state` });
    this.hint = cell("hint");
    this.numbers = ["rate", "age"].map(() => cell("number"));
    this.skipped = cell("number");
    this.root = h("tr", { "data-testid": `device-${name}` }, this.name, h("td", {}, this.state), this.hint, ...this.numbers, this.skipped);
  }

  show(device, silence) {
    showState(this.state, device.state);
    showHint(this.hint, device.hint || device.driver);
    setText(this.numbers[0], isNumber(device.rate_hz) ? `${fixed(device.rate_hz, 1)} Hz` : "–");
    setText(this.numbers[1], age(isNumber(device.age_ms) ? device.age_ms + silence : null));
    const skipped = Object.entries(device.skipped ?? {});
    const total = skipped.reduce((sum, [, count]) => sum + count, 0);
    showCount(this.skipped, total ? bytes(total) : "0", total);
    setAttribute(this.skipped, "title", skipped.map(([reason, count]) => `${title(reason)}: ${count} bytes`).join("\n"));
  }
}

// The alarms of the daemon: tiles of the most urgent, a list of all, acknowledgement.

import { clock, duration } from "./format.js";
import { h, Keyed, setAttribute, setClass, setText } from "./dom.js";
import { Tone } from "./tone.js";

const MOST_TILES = 3;

const isLasting = (alarm) => alarm.end_ns === null;
const isNew = (alarm) => !alarm.is_acknowledged;

// Begin, duration and count of an alarm.
function times(alarm, tNs) {
  const lasted = duration((alarm.end_ns ?? tNs) - alarm.begin_ns);
  const parts = [clock(alarm.begin_ns)];
  if (isLasting(alarm)) parts.push(lasted);
  else if (alarm.end_ns > alarm.begin_ns) parts.push(`ended after ${lasted}`);
  if (alarm.count > 1) parts.push(`${alarm.count} times`);
  return parts.join(" · ");
}

export class Alarms {
  // command : sends a command to the daemon, resolves to a fault or null; keys : of the page
  constructor(root, command, keys) {
    this.command = command;
    this.tone = new Tone();
    this.quiet = h("p", { class: "quiet", "data-testid": "no-alarms" }, "NO ALARMS");
    const tiles = h("div", { class: "tiles" });
    this.tiles = new Keyed(tiles, (id) => new Tile(id, () => this.#acknowledge(id)));
    this.fault = h("span", { class: "alarm-fault", "data-testid": "alarm-fault" });
    this.more = h("button", { type: "button", "data-testid": "alarm-more", "aria-expanded": "false" });
    this.more.addEventListener("click", () => this.#openList(this.list.hidden));
    this.button = h("button", { type: "button", "data-testid": "acknowledge", title: "key a" }, "ACKNOWLEDGE");
    this.button.addEventListener("click", () => this.#acknowledge(null));
    this.side = h("div", { class: "alarm-side" }, this.more, this.button, this.tone.button, keys.button);
    this.list = h("ol", { class: "alarm-list", "data-testid": "alarm-list", hidden: "" });
    root.append(this.quiet, tiles, this.fault, this.side, this.list);
    keys.add("a", "acknowledge all alarms", () => this.#acknowledge(null));
    keys.closeOnEscape(this.list, () => this.#openList(false));
    this.permitted = false;
  }

  permit(fault) {
    this.permitted = fault === null;
    this.button.disabled = !this.permitted;
    if (fault) setAttribute(this.button, "title", fault);
  }

  show({ alarms, t_ns: tNs }) {
    this.quiet.hidden = alarms.length > 0;
    this.button.hidden = !alarms.some(isNew);
    const shown = alarms.slice(0, MOST_TILES);
    const tiles = this.tiles.sync(shown.map((alarm) => alarm.id));
    for (const alarm of shown) tiles.get(alarm.id).show(alarm, tNs);
    setText(this.more, `${alarms.length} ${alarms.length === 1 ? "ALARM" : "ALARMS"}`);
    this.more.hidden = alarms.length === 0;
    if (!alarms.length) this.#openList(false);
    if (!this.list.hidden) this.list.replaceChildren(...alarms.map((alarm) => makeItem(alarm, tNs)));
    this.last = { alarms, t_ns: tNs };
    this.tone.sound(alarms.some((alarm) => alarm.severity === "warning" && isLasting(alarm) && isNew(alarm)));
  }

  #openList(open) {
    if (open === !this.list.hidden) return;
    this.list.hidden = !open;
    setAttribute(this.more, "aria-expanded", open);
    if (open && this.last) this.show(this.last);
  }

  async #acknowledge(id) {
    if (!this.permitted) return;
    setText(this.fault, (await this.command({ command: "acknowledge", alarm: id })) ?? "");
  }
}

class Tile {
  constructor(id, press) {
    [this.title, this.cause, this.times] = [h("strong"), h("span"), h("small")];
    this.root = h("button", { type: "button", class: "tile", "data-testid": `alarm-${id}` }, this.title, this.cause, this.times);
    this.root.addEventListener("click", press);
  }

  show(alarm, tNs) {
    const more = alarm.consequences.length ? ` +${alarm.consequences.length}` : "";
    setAttribute(this.root, "data-severity", alarm.severity);
    setAttribute(this.root, "title", [alarm.cause, ...alarm.consequences.map(({ title }) => title)].join("\n"));
    setClass(this.root, "ended", !isLasting(alarm));
    setClass(this.root, "acknowledged", !isNew(alarm));
    setText(this.title, alarm.title + more);
    setText(this.cause, alarm.cause);
    setText(this.times, times(alarm, tNs));
  }
}

function makeItem(alarm, tNs) {
  const who = alarm.acknowledged_by ? `acknowledged by ${alarm.acknowledged_by}` : "not acknowledged";
  const consequences = alarm.consequences.map((each) => h("li", {}, h("b", {}, each.title), ` ${each.cause}`));
  return h(
    "li",
    { "data-severity": alarm.severity, "data-testid": `alarm-item-${alarm.id}` },
    h("time", {}, times(alarm, tNs)),
    h("b", {}, alarm.title),
    h("span", {}, alarm.cause),
    h("small", {}, who),
    h("ul", {}, ...consequences),
  );
}

// The annunciator row: always there, so that nothing jumps when an alarm comes.

import { h, Keyed, setAttribute, setText } from "./dom.js";

export class Alarms {
  constructor(root) {
    this.quiet = h("p", { class: "quiet", "data-testid": "no-alarms" }, "NO ALARMS");
    const list = h("div", { class: "tiles" });
    root.append(this.quiet, list);
    this.tiles = new Keyed(list, makeTile);
  }

  show({ alarms }) {
    this.quiet.hidden = alarms.length > 0;
    const tiles = this.tiles.sync(alarms.map((alarm) => alarm.id));
    for (const alarm of alarms) {
      const tile = tiles.get(alarm.id);
      setAttribute(tile.root, "data-level", alarm.level);
      setAttribute(tile.root, "title", alarm.detail);
      setText(tile.title, alarm.title);
      setText(tile.detail, alarm.detail);
    }
  }
}

function makeTile(id) {
  const title = h("strong");
  const detail = h("span");
  return { root: h("div", { class: "tile", "data-testid": `alarm-${id}` }, title, detail), title, detail };
}

// What happened, the newest first.

import { clock, title } from "./format.js";
import { h, panelTitle } from "./dom.js";

export class Events {
  constructor(root) {
    this.heading = panelTitle("Events", "");
    this.list = h("ol", { class: "scroll", "data-testid": "events" });
    root.append(this.heading.root, this.list);
    this.shown = "";
  }

  show({ events }) {
    const newest = events[events.length - 1];
    const identity = newest ? `${events.length} ${newest.t_ns} ${newest.text}` : "";
    if (identity === this.shown) return;
    this.shown = identity;
    this.list.replaceChildren(...events.toReversed().map(makeItem));
  }
}

function makeItem({ t_ns: tNs, level, source, text }) {
  return h("li", { "data-level": level }, h("time", {}, clock(tNs)), h("span", {}, h("b", {}, title(source)), text));
}

// The events, newest first; above them the field for marks.

import { clock, title } from "./format.js";
import { h, panelTitle } from "./dom.js";
import { MarkField } from "./marks.js";

export class Events {
  constructor(root, command, keys) {
    this.list = h("ol", { class: "scroll", "data-testid": "events" });
    this.marks = new MarkField(command, keys);
    root.append(panelTitle("Events").root, this.marks.root, this.list);
    this.shown = "";
  }

  permit(fault) {
    this.marks.permit(fault);
  }

  show({ events, health }) {
    this.marks.show({ health });
    const newest = events[events.length - 1];
    const identity = newest ? `${events.length} ${newest.t_ns} ${newest.text}` : "";
    if (identity === this.shown) return;
    this.shown = identity;
    this.list.replaceChildren(...events.toReversed().map(makeItem));
  }
}

function makeItem({ t_ns: tNs, level, source, text }) {
  return h("li", { "data-level": level, "data-source": source }, h("time", {}, clock(tNs)), h("span", {}, h("b", {}, title(source)), text));
}

// Outputs for other programs: each sink with its state, what it has sent, and what was lost.  A laptop shows only the state
// and, below it, the failure and lost events.

import { isNumber, UNKNOWN } from "./format.js";
import { setText } from "./dom.js";
import { numberCell, Row, showCount, Table } from "./tables.js";

const COLUMNS = ["program", "state", "peers", "sent", "replaced", "lost events"];

export class Sinks extends Table {
  constructor(root) {
    super(root, "Other programs", COLUMNS, (name) => new SinkRow(name));
    root.hidden = true;
    this.root = root;
  }

  show({ health }) {
    const sinks = health?.sinks ?? {};
    this.root.hidden = !Object.keys(sinks).length;
    this.showRows(sinks);
    const states = Object.values(sinks).map(({ state }) => state);
    setText(this.heading.side, `${states.filter((state) => state === "connected").length} of ${states.length} connected`);
  }
}

class SinkRow extends Row {
  constructor(name) {
    const [peers, sent, replaced, lost] = Array.from({ length: 4 }, numberCell);
    super("sink", name, [peers, sent, replaced, lost]);
    Object.assign(this, { peers, sent, replaced, lost });
  }

  show(sink) {
    const lost = sink.lost_events ? [`${sink.lost_events} events lost`] : [];
    this.showState({ ...sink, hint: [...(sink.hint ? [sink.hint] : []), ...lost].join("; ") }, "");
    setText(this.peers, isNumber(sink.peers) ? String(sink.peers) : UNKNOWN);
    setText(this.sent, String(sink.sent));
    setText(this.replaced, String(sink.replaced));
    const waiting = sink.waiting_events ? `${sink.waiting_events} events wait` : "";
    showCount(this.lost, String(sink.lost_events), waiting);
  }
}

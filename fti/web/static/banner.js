// Origin of the data, state and file of the recording.

import { age, bytes, clock, duration, title, UNKNOWN } from "./format.js";
import { h, Keyed, setAttribute, setText } from "./dom.js";

const ORIGINS = {
  hil: ["HIL", "emulated sensors, no flight"],
  replay: ["REPLAY", "bytes of an earlier session"],
  flight: ["FLIGHT", ""],
};
const MODES = { snapshot: ["SNAPSHOT", "only data around a trigger are recorded"] };
const RECORDING = { waiting: "WAITING", recording: "RECORDING", storage_error: "NOT RECORDING", stopping: "STOPPING", stopped: "STOPPED" };

// A snapshot session records nothing between the triggers.
const stateOf = ({ state, mode }, snapshot) =>
  state === "recording" && mode === "snapshot" && snapshot?.state !== "writing" ? "waiting" : state;

const lastPart = (path) => (path ?? "").split("/").pop();

// The aircraft, at a ground station: its pages are below aircraft/NAME/; null for the page of a daemon.
function aircraftOfPage() {
  const found = /\/aircraft\/([^/]+)\/$/.exec(location.pathname);
  return found && decodeURIComponent(found[1]);
}

function field(label, testid) {
  const value = h("b", { "data-testid": testid }, "–");
  return { root: h("div", { class: "field" }, h("span", {}, label), value), value };
}

export class Banner {
  constructor(root) {
    this.root = root;
    this.origin = h("strong", { class: "origin", "data-testid": "origin" }, "–");
    this.originText = h("span", { class: "origin-text" });
    this.mode = h("strong", { class: "origin", "data-testid": "mode" });
    this.modeText = h("span", { class: "origin-text" });
    this.modeBlock = h("div", { class: "origin-block mode-block" }, this.mode, this.modeText);
    this.session = field("session", "session");
    this.state = h("strong", { class: "recording", "data-testid": "recording" }, "–");
    this.file = field("file", "file");
    this.size = field("size", "file-size");
    this.age = field("age", "file-age");
    this.free = field("free", "free-space");
    this.elapsed = field("elapsed", "elapsed");
    this.utc = field("FTI time", "utc");
    const list = h("div", { class: "processes" });
    this.processes = new Keyed(list, makeProcess);
    const fields = [this.file, this.size, this.age, this.free].map((f) => f.root);
    const aircraft = aircraftOfPage();
    if (aircraft) {
      document.title = aircraft;
      root.append(h("a", { class: "aircraft", href: "../../", title: "all aircraft", "data-testid": "aircraft" }, aircraft));
    }
    root.append(
      h("div", { class: "origin-block" }, this.origin, this.originText),
      this.modeBlock,
      this.session.root,
      h("div", { class: "record-block" }, this.state, ...fields),
      list,
      h("div", { class: "times" }, this.elapsed.root, this.utc.root),
    );
  }

  show({ health, t_ns: tNs }) {
    if (!health) return;
    const { session, storage, processes } = health;
    this.#showOrigin(session.origin);
    this.#showMode(session.mode ?? "continuous");
    const folder = lastPart(session.folder) || session.name;
    setText(this.session.value, folder);
    document.title = `${folder} · fti`;
    const state = stateOf(session, health.snapshot);
    setText(this.state, RECORDING[state] ?? state);
    setAttribute(this.state, "data-state", state);
    setAttribute(this.state, "data-storage", storage.state);
    setText(this.file.value, lastPart(storage.file).replace(`${folder}_`, "") || UNKNOWN);
    setText(this.size.value, bytes(storage.file_bytes));
    setText(this.age.value, age(storage.file_age_s * 1000));
    setText(this.free.value, bytes(storage.free_mb * 1e6));
    setText(this.elapsed.value, duration(tNs - session.started_ns));
    setText(this.utc.value, `${clock(tNs)} UTC`);
    this.#showProcesses(processes);
  }

  #showOrigin(origin) {
    const [word, text] = ORIGINS[origin] ?? [origin, ""];
    setAttribute(this.root, "data-origin", origin);
    setText(this.origin, word);
    setText(this.originText, text);
  }

  #showMode(mode) {
    const [word, text] = MODES[mode] ?? [mode.toUpperCase(), ""];
    this.modeBlock.hidden = mode === "continuous";
    setText(this.mode, word);
    setText(this.modeText, text);
  }

  #showProcesses(processes) {
    const items = this.processes.sync(Object.keys(processes));
    for (const [name, process] of Object.entries(processes)) {
      const item = items.get(name);
      const restarts = process.restarts ? ` · ${process.restarts} restarts` : "";
      setAttribute(item.root, "data-state", process.state);
      setAttribute(item.root, "title", `${title(name)}: ${process.state}${restarts}`);
      setText(item.state, process.state + (process.restarts ? ` ↻${process.restarts}` : ""));
    }
  }
}

function makeProcess(name) {
  const state = h("b", {}, "–");
  return { root: h("div", { class: "process", "data-testid": `process-${name}` }, h("span", {}, name), state), state };
}

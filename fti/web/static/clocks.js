// The clock of a device relative to FTI time, below its row: offset, drift, share of late messages.

import { fixed, isNumber, plusMinus } from "./format.js";
import { h, setAttribute, setText } from "./dom.js";

const LAST_DATE_MS = 8.64e15; // limit of Date
const LONG_MS = 10_000; // a larger offset is shown in seconds
const NAMES = { gps: "GPS clock", utc: "UTC clock", boot: "own clock" };
const STATES = { learning: "learning: arrival time used", away: "does not fit: arrival time used" };

export class ClockRow {
  constructor(device, scale, columns) {
    const part = (name) => h("span", { "data-testid": `device-${device}-${scale}-${name}` });
    [this.offset, this.drift, this.late, this.state] = ["offset", "drift", "late", "state"].map(part);
    this.name = h("span", {}, NAMES[scale] ?? scale);
    const line = h("div", {}, this.name, this.offset, this.drift, this.late, this.state);
    this.root = h("tr", { class: "clock" }, h("td", { colspan: columns }, line));
  }

  show(clock) {
    const good = clock.state === "good";
    setAttribute(this.root, "data-state", clock.state);
    setText(this.offset, good ? offset(clock) : "");
    setText(this.drift, good ? `${withSigma(clock.drift_ppm, clock.drift_sd_ppm)} ppm` : "");
    setText(this.late, good ? `${fixed(100 * clock.late_share, 1)} % late` : "");
    setText(this.state, good ? (clock.used ? "" : "not used") : (STATES[clock.state] ?? clock.state));
    setAttribute(this.root, "title", explain(clock));
  }
}

// For a clock that counts from power-on, the time of power-on; otherwise the offset to FTI time.
function offset({ scale, offset_ms: value, offset_sd_ms: sd }) {
  if (!isNumber(value) || Math.abs(value) > LAST_DATE_MS) return fixed(null);
  if (scale === "boot") return `on at ${new Date(-value).toISOString().slice(11, 23)}`;
  return Math.abs(value) < LONG_MS ? `${withSigma(value, sd)} ms` : `${fixed(value / 1000, 3, { sign: true })} s`;
}

function withSigma(value, sd) {
  const digits = sd < 0.01 ? 3 : sd < 1 ? 2 : 1;
  return `${fixed(value, digits, { sign: true })} ${plusMinus(sd, digits)}`;
}

function explain({ messages, refused, used }) {
  const share = "offset: device \u2212 FTI time (GPS time as UTC); drift: relative to FTI time; one sigma";
  const use = used ? "validity times are taken from it" : "use_device_time = false: the arrival time is used";
  return `${share}\n${messages} messages, ${refused} refused; ${use}`;
}

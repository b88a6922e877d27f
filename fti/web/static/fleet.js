// The overview of a ground station: one row for each aircraft; each has a page of its own.

import { age, degrees, fixed, isNumber, latLon, UNKNOWN } from "./format.js";
import { h, Keyed, setClass, setText } from "./dom.js";

const RETRY_MS = 1000;
const SILENCE_MS = 3000;
const CONTACT_MS = 5000; // without a message for so long, an aircraft counts as silent

const metres = (value, digits) => (isNumber(value) ? `${fixed(value, digits)} m` : UNKNOWN);

class AircraftRow {
  constructor(name) {
    this.link = h("a", { href: `aircraft/${encodeURIComponent(name)}/`, "data-testid": `aircraft-${name}` }, name);
    this.origin = h("span", { class: "origin" });
    this.cells = ["session", "contact", "position", "altitude", "height", "integrity", "glide", "alarms"].map((column) =>
      h("td", { "data-testid": `${column}-${name}` }),
    );
    this.root = h("tr", {}, h("td", {}, this.link, this.origin), ...this.cells);
  }

  show(row) {
    const [session, contact, position, altitude, height, integrity, glide, alarms] = this.cells;
    setText(this.origin, row.origin && row.origin !== "flight" ? row.origin.toUpperCase() : "");
    setText(session, row.session);
    setText(contact, `${age(row.contact_ms)} ago`);
    setClass(this.root, "silent", row.contact_ms > CONTACT_MS);
    showOutput(position, row.position, (fields) => latLon(fields.lat, fields.lon).join(" "));
    showOutput(altitude, row.position, (fields) => metres(fields.alt, 0));
    showOutput(height, row.height, (fields) => metres(fields.height_agl, 1));
    showOutput(glide, row.glide, (fields) => `${fixed(degrees(fields.deviation), 2, { sign: true })}°`);
    const state = row.integrity && !row.integrity.late ? row.integrity.state : "";
    setText(integrity, state ? state.replaceAll("_", " ").toUpperCase() : UNKNOWN);
    integrity.className = state;
    setText(alarms, row.worst ? `${row.worst.title}${row.alarms > 1 ? ` +${row.alarms - 1}` : ""}` : "none");
    alarms.className = row.worst?.severity ?? "";
  }
}

// A value that is late or not valid must not be used: it is struck out.
function showOutput(cell, output, text) {
  setText(cell, output ? text(output) : UNKNOWN);
  setClass(cell, "struck", output && (output.late || !output.valid));
}

class Overview {
  constructor() {
    this.rows = new Keyed(document.getElementById("rows"), (name) => new AircraftRow(name));
    this.state = document.getElementById("state");
    this.lastAt = 0;
    setInterval(() => this.#watch(), 250);
    this.#connect();
  }

  #connect() {
    const socket = new WebSocket(`ws://${location.host}/fleet/ws`);
    socket.onmessage = (event) => this.#show(JSON.parse(event.data).aircraft);
    socket.onclose = () => setTimeout(() => this.#connect(), RETRY_MS);
  }

  #show(aircraft) {
    this.lastAt = Date.now();
    const rows = this.rows.sync(aircraft.map((row) => row.aircraft));
    for (const row of aircraft) rows.get(row.aircraft).show(row);
    setText(this.state, aircraft.length ? `${aircraft.length} aircraft` : "no aircraft has sent anything yet");
  }

  #watch() {
    const isSilent = Date.now() - this.lastAt > SILENCE_MS;
    setClass(document.body, "disconnected", isSilent);
    if (isSilent) setText(this.state, "NO CONNECTION TO fti ground");
  }
}

new Overview();

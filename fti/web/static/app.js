// The page: every panel gets each message of the server.

import { Alarms } from "./alarms.js";
import { Attitude } from "./attitude.js";
import { Banner } from "./banner.js";
import { Commands } from "./commands.js";
import { Connection } from "./connection.js";
import { Events } from "./events.js";
import { Glide } from "./glide.js";
import { Heights } from "./heights.js";
import { Integrity } from "./integrity.js";
import { Keys } from "./keys.js";
import { Laboratory } from "./laboratory.js";
import { Sinks } from "./sinks.js";
import { Devices, Links } from "./tables.js";

const place = (id) => document.getElementById(id);

// The panels exist before the connection.
let connection = null;
const command = (fields) => connection?.command(fields) ?? Promise.resolve("no connection");

const keys = new Keys();
const links = new Links(place("links"));
const panels = [
  new Banner(place("banner")),
  new Alarms(place("alarms"), command, keys),
  new Laboratory(place("laboratory"), command),
  new Heights(place("heights")),
  new Integrity(place("integrity")),
  new Glide(place("glide")),
  new Attitude(place("attitude")),
  links,
  new Commands(place("commands"), links, command, keys),
  new Devices(place("devices")),
  new Sinks(place("sinks")),
  new Events(place("events"), command, keys),
];

function onMessage(message) {
  if (message.type === "history") {
    for (const panel of panels) panel.load?.(message);
    return;
  }
  if (message.type === "commands") {
    for (const panel of panels) panel.take?.(message);
    return;
  }
  const stopped = message.alarms.some((alarm) => alarm.id === "daemon");
  document.body.classList.toggle("daemon-stopped", stopped);
  for (const panel of panels) panel.show?.(message);
}

function onPermission(fault) {
  for (const panel of panels) panel.permit?.(fault);
}

document.fonts.load("12px B612").finally(() => {
  connection = new Connection(onMessage, onPermission);
});

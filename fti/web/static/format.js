// Number formats.  An unknown value is a dash.

export const UNKNOWN = "–";
const MINUS = "\u2212";
const DEGREE = Math.PI / 180;

export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

export const degrees = (radians) => (isNumber(radians) ? radians / DEGREE : null);

export function fixed(value, digits, { sign = false } = {}) {
  if (!isNumber(value)) return UNKNOWN;
  const text = Math.abs(value).toFixed(digits);
  const zero = Number(text) === 0;
  return (value < 0 && !zero ? MINUS : sign && !zero ? "+" : "") + text;
}

export const plusMinus = (value, digits) => (isNumber(value) ? `± ${value.toFixed(digits)}` : "");

export function bytes(count) {
  if (!isNumber(count)) return UNKNOWN;
  const units = ["B", "kB", "MB", "GB", "TB"];
  let power = 0;
  while (count >= 1000 && power < units.length - 1) {
    count /= 1000;
    power += 1;
  }
  return `${power ? count.toPrecision(3) : count} ${units[power]}`;
}

export function age(milliseconds) {
  if (!isNumber(milliseconds)) return UNKNOWN;
  const seconds = milliseconds / 1000;
  if (seconds < 10) return `${seconds.toFixed(seconds < 1 ? 2 : 1)} s`;
  return seconds < 600 ? `${seconds.toFixed(0)} s` : `${(seconds / 60).toFixed(0)} min`;
}

export function clock(tNs) {
  return isNumber(tNs) ? new Date(tNs / 1e6).toISOString().slice(11, 19) : "--:--:--";
}

export function duration(ns) {
  if (!isNumber(ns) || ns < 0) return "--:--";
  const seconds = Math.floor(ns / 1e9);
  const parts = [Math.floor(seconds / 60) % 60, seconds % 60].map((n) => String(n).padStart(2, "0"));
  return [...(seconds >= 3600 ? [Math.floor(seconds / 3600)] : []), ...parts].join(":");
}

export function latLon(lat, lon) {
  const part = (value, digits, [positive, negative]) =>
    isNumber(value) ? `${Math.abs(degrees(value)).toFixed(5).padStart(digits, "0")}° ${value < 0 ? negative : positive}` : UNKNOWN;
  return [part(lat, 8, "NS"), part(lon, 9, "EW")];
}

export const title = (name) => name.replaceAll("_", " ");

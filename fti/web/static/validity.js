// Display of values that must not be used: struck out, grey, with the reason.

import { age } from "./format.js";
import { setAttribute, setClass, setText } from "./dom.js";

export function describe(output) {
  if (!output) return { text: "NO DATA", kind: "none" };
  if (output.late) return { text: `STALE ${age(output.age_ms)}`, kind: "stale" };
  if (!output.valid) return { text: output.reasons_text.join(", ") || "invalid", kind: "invalid" };
  return { text: "VALID", kind: "valid" };
}

// Strike the values and write the validity.
export function showValidity(output, values, validity) {
  const { text, kind } = describe(output);
  for (const value of values) setClass(value, "struck", kind === "stale" || kind === "invalid");
  setText(validity, text);
  setAttribute(validity, "data-kind", kind);
  setAttribute(validity, "title", text);
}

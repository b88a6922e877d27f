// The fallback solutions: standard deviations, and reasons of invalid ones.  The position from the ground aids the filter.
// Below them the provisional filters of unconfirmed sources: distance from the filter, protection level.

import { h, Keyed, setAttribute, setText } from "./dom.js";
import { fixed, plusMinus } from "./format.js";
import { describe } from "./validity.js";

const NAMES = {
  "/nav/filter_solution": ["filter", "filter"],
  "/nav/vertical_solution": ["vertical", "vertical channel"],
  "/nav/position_fix": ["fix", "satellites, DME"],
};

const GROUND = "/nav/terrain_fix";

const DRIFT = "/nav/ground_drift";

const PROVISIONAL = "/nav/provisional_solution/";

export class Fallbacks {
  constructor() {
    this.root = h("div", { class: "fallbacks", "data-testid": "fallbacks" });
    this.rows = new Keyed(this.root, makeRow);
  }

  show(outputs) {
    const topics = Object.keys(NAMES).filter((topic) => topic in outputs);
    // Filters that have ended are no longer published.
    const provisional = Object.keys(outputs).filter((topic) => topic.startsWith(PROVISIONAL) && !outputs[topic].late);
    const ground = GROUND in outputs ? [GROUND] : [];
    const drift = DRIFT in outputs ? [DRIFT] : [];
    const rows = this.rows.sync([...topics, ...ground, ...drift, ...provisional]);
    for (const topic of ground) showGround(rows.get(topic), outputs[topic]);
    for (const topic of drift) showDrift(rows.get(topic), outputs[topic]);
    for (const topic of provisional) showProvisional(rows.get(topic), outputs[topic]);
    for (const topic of topics) {
      const { sd, validity, root } = rows.get(topic);
      const output = outputs[topic];
      const { text, kind } = describe(output);
      const sigmas = [plusMinus(output.horizontal_sd, 0), plusMinus(output.vertical_sd, 1)].filter(Boolean);
      const words = kind === "valid" ? [output.mode ?? "valid", ...output.reasons_text] : [text];
      setText(sd, sigmas.length ? `${sigmas.join(", ")} m` : "");
      setText(validity, [...new Set(words)].join(", "));
      setAttribute(validity, "data-kind", kind);
      setAttribute(root, "title", sigmas.length === 2 ? `level ${sigmas[0]} m, height ${sigmas[1]} m` : text);
    }
  }
}

// The fix of the last profile: its sigma and validity; its distance from the filter and its profile in the title.
function showGround({ sd, validity, root }, output) {
  const { text, kind } = describe(output);
  const hasPlace = output.north_sd != null;
  const distance = hasPlace ? `${fixed(Math.hypot(output.shift_north, output.shift_east), 0)} m from` : "";
  const words = kind === "valid" ? [output.is_search ? "confirmed" : "valid", ...output.unchecked_text] : [text];
  setText(sd, hasPlace ? `${plusMinus(Math.max(output.north_sd, output.east_sd), 0)} m` : "");
  setText(validity, words.join(", "));
  setAttribute(validity, "data-kind", kind);
  const samples = `${output.samples} ${output.method === "beams" ? "frames of beams" : "heights"}`;
  const from = hasPlace ? `${distance} the filter; ${samples} over ${fixed(output.length, 0)} m; search to ${fixed(output.reach, 0)} m` : text;
  setAttribute(root, "title", from);
}

// The drift between the last two looks: its length, sigma and overlap; refused pairs in the title.
function showDrift({ sd, validity, root }, output) {
  const { text, kind } = describe(output);
  const hasDrift = output.north_sd != null;
  const length = hasDrift ? fixed(Math.hypot(output.north, output.east), 2) : "";
  const sigma = hasDrift ? plusMinus(Math.max(output.north_sd, output.east_sd), 2) : "";
  const overlap = output.overlap == null ? "" : `${fixed(100 * output.overlap, 0)} %`;
  setText(sd, [hasDrift ? `${length} ${sigma} m` : "", overlap].filter(Boolean).join(", "));
  setText(validity, kind === "valid" ? "valid" : text);
  setAttribute(validity, "data-kind", kind);
  const common = overlap && `; ${overlap} of the points on common ground`;
  const pairs = output.pairs == null ? "" : `; ${output.refused} of ${output.pairs} pairs did not aid`;
  const interval = output.interval == null ? "" : ` in ${fixed(output.interval, 1)} s`;
  const directions = output.directions == null ? "" : `, ${output.directions} directions determined`;
  setAttribute(root, "title", `drift of the filter between two looks at the ground${interval}${directions}${common}${pairs}`);
}

function showProvisional({ sd, validity, root }, output) {
  const { text, kind } = describe(output);
  const height = fixed(output.height_difference, 0, { sign: true });
  setText(sd, `${fixed(output.distance, 0)} m off, height ${height} m · HPL ${fixed(output.hpl, 0)}`);
  setText(validity, text);
  setAttribute(validity, "data-kind", kind);
  setAttribute(root, "title", `provisional filter with ${output.quantities.join(", ")}; used again after ${output.readmission}`);
}

function makeRow(topic) {
  const source = topic.slice(PROVISIONAL.length);
  const single = { [GROUND]: ["ground", "ground"], [DRIFT]: ["drift", "drift"] };
  const [id, name] = single[topic] ?? NAMES[topic] ?? [`provisional-${source}`, source];
  const sd = h("span", { class: "sd", "data-testid": `fallback-${id}-sd` });
  const validity = h("span", { class: "validity", "data-testid": `fallback-${id}-validity` });
  return { root: h("div", { "data-testid": `fallback-${id}` }, h("strong", {}, name), " ", sd, " ", validity), sd, validity };
}

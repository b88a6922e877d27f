// What stands ready in place of devices, or has taken it: how good it is, and why it is not better.

import { h, Keyed, setAttribute, setText } from "./dom.js";
import { plusMinus } from "./format.js";
import { describe } from "./validity.js";

const NAMES = {
  "/nav/filter_solution": ["filter", "filter"],
  "/nav/vertical_solution": ["vertical", "vertical channel"],
  "/nav/position_fix": ["fix", "satellites, DME"],
};

export class Fallbacks {
  constructor() {
    this.root = h("div", { class: "fallbacks", "data-testid": "fallbacks" });
    this.rows = new Keyed(this.root, makeRow);
  }

  show(outputs) {
    const topics = Object.keys(NAMES).filter((topic) => topic in outputs);
    const rows = this.rows.sync(topics);
    for (const topic of topics) {
      const { sd, verdict, root } = rows.get(topic);
      const output = outputs[topic];
      const { text, kind } = describe(output);
      const sigmas = [plusMinus(output.horizontal_sd, 0), plusMinus(output.vertical_sd, 1)].filter(Boolean);
      const words = kind === "valid" ? [output.mode ?? "valid", ...output.reasons_text] : [text];
      setText(sd, sigmas.length ? `${sigmas.join(", ")} m` : "");
      setText(verdict, [...new Set(words)].join(", "));
      setAttribute(verdict, "data-kind", kind);
      setAttribute(root, "title", sigmas.length === 2 ? `level ${sigmas[0]} m, height ${sigmas[1]} m` : text);
    }
  }
}

function makeRow(topic) {
  const [id, name] = NAMES[topic];
  const sd = h("span", { class: "sd", "data-testid": `fallback-${id}-sd` });
  const verdict = h("span", { class: "verdict", "data-testid": `fallback-${id}-verdict` });
  return { root: h("div", { "data-testid": `fallback-${id}` }, h("strong", {}, name), sd, verdict), sd, verdict };
}

"""The plot page of ``fti sync``: one self-contained HTML file, with uPlot, that loads nothing."""

from __future__ import annotations

import html
import json
from importlib.resources import files

from fti.post.sync import Sync
from fti.post.sync_report import as_text, computer_curve, curves

_UPLOT = files("fti.web") / "static" / "vendor" / "uplot-1.6.32"
_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 24px; color: #1a2733; background: #fff; max-width: 1100px; }
h1 { font-size: 18px; } h2 { font-size: 15px; margin: 24px 0 4px; } h2 small { font-weight: normal; color: #5b6b7a; }
pre { background: #f3f6f9; padding: 12px; overflow-x: auto; }
"""
_SCRIPT = """
const GREY = "#5b6b7a", LINE = "#c0392b", POINTS = "#2c7fb8";
const axis = (label, size) => ({ label, size, labelSize: 22, stroke: GREY, grid: { stroke: "#e4eaf0", width: 1 } });
const points = (label) => ({ label, stroke: POINTS, paths: () => null, points: { show: true, size: 3, fill: POINTS } });
for (const curve of JSON.parse(document.getElementById("curves").textContent)) {
  const place = document.getElementById(curve.id);
  const series = [{ label: "FTI time [s]" }];
  const data = [curve.t];
  if (curve.high) { series.push(points("latest")); data.push(curve.high); }
  if (curve.low) { series.push(points("earliest")); data.push(curve.low); }
  series.push({ label: curve.low ? "minimum delay" : "difference", stroke: LINE, width: 2 });
  data.push(curve.line);
  new uPlot({
    width: Math.max(place.clientWidth, 400), height: 320, series,
    scales: { x: { time: false }, y: { range: (_, min, max) => [Math.min(min, -0.5), Math.max(max, 0.5)] } },
    axes: [axis("FTI time since the start [s]", 44), axis("ms", 64)],
  }, data, place);
}
"""


def page(sync: Sync, title: str) -> str:
    """The page as text.  title : of the session."""
    computer = computer_curve(sync)
    shown = [{**curve, "id": f"plot{i}"} for i, curve in enumerate([*curves(sync), *([computer] if computer else [])])]
    plots = "\n".join(
        f'<h2>{html.escape(c["title"])} <small>{html.escape(c["drift"])}</small></h2><div id="{c["id"]}"></div>'
        for c in shown
    )
    data = json.dumps(shown, separators=(",", ":")).replace("<", "\\u003c")
    uplot = (_UPLOT / "uPlot.esm.js").read_text(encoding="utf-8").replace("export { uPlot as default };", "")
    css = (_UPLOT / "uPlot.min.css").read_text(encoding="utf-8")
    return f"""<!doctype html>
<html lang="en">
<head><meta charset="utf-8"><title>{html.escape(title)}: clocks</title><style>{css}{_STYLE}</style></head>
<body>
<h1>{html.escape(title)}: clocks against FTI time</h1>
<pre>{html.escape(chr(10).join(as_text(sync)))}</pre>
<p>Differences are relative to their value at the start. Each dot is the earliest or the latest message around its time;
the line is the minimum delay, below which almost no message lies. A falling line is a fast clock.</p>
{plots}
<script type="application/json" id="curves">{data}</script>
<script type="module">
{uplot}
{{{_SCRIPT}}}
</script>
</body>
</html>
"""

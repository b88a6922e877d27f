"""Output of ``fti sync``: JSON, text, and curves for the plot."""

from __future__ import annotations

import html
import json
from importlib.resources import files
from typing import Any

import numpy as np

from fti.arrays import Ints
from fti.constants import SECOND_NS
from fti.nav.device_time.clock_estimator import NEAR_FACTOR, NEAR_NS, ClockSegment
from fti.post.sync import DeviceClockSeries, Sync

#: Columns of a plotted curve: each keeps its earliest and its latest message.
BINS = 700


def as_json(sync: Sync) -> dict[str, Any]:
    """Times in ns, drifts in ppm (positive: faster than FTI time), delays in ms.

    drift_95_ppm : half of the 95 % interval
    delay        : of the messages, beyond the minimum delay; late : messages beyond ``late_beyond_ms``
    """
    return {
        "session": dict(sync.session_metadata),
        "begin_ns": sync.begin_ns,
        "devices": [_device(clock_series) for clock_series in sync.clock_series],
        "computer": _computer(sync),
        "gnss": _gnss(sync),
    }


def _device(clock_series: DeviceClockSeries) -> dict[str, Any]:
    return {
        "device": clock_series.device.name,
        "link": clock_series.device.link,
        "scale": clock_series.scale.value,
        "messages": len(clock_series.t_rx),
        "refused": clock_series.clock.refused,
        "segments": [_segment(clock_series, segment) for segment in clock_series.clock.segments],
    }


def _segment(clock_series: DeviceClockSeries, segment: ClockSegment) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "first_ns": segment.first_ns,
        "last_ns": segment.last_ns,
        "messages": segment.messages,
        "known": segment.is_known,
    }
    if not segment.is_known:
        return entry
    latency_ns = round(clock_series.device.latency_ms * 1e6)
    first_dev_ns, last_dev_ns = (segment.device_ns(t + latency_ns) for t in (segment.first_ns, segment.last_ns))
    delays = clock_series.delays(segment)[1] / 1e6
    late_ms = (NEAR_NS + NEAR_FACTOR * segment.line.spread) / 1e6
    return entry | {
        "offset_ns": first_dev_ns - segment.first_ns,
        "offset_end_ns": last_dev_ns - segment.last_ns,
        "offset_sd_ns": segment.sd_ns(first_dev_ns),
        "drift_ppm": segment.drift_ppm,
        "drift_95_ppm": 1e6 * segment.line.slope_95,
        "method": segment.line.method,
        "resolution_ns": segment.resolution_ns,
        "delay_ms": dict(zip(("p50", "p99", "max"), np.percentile(delays, (50, 99, 100)).tolist(), strict=True)),
        "late": int(np.count_nonzero(delays > late_ms)),
        "late_beyond_ms": late_ms,
    }


def _computer(sync: Sync) -> dict[str, Any]:
    clock = sync.computer
    if len(clock.t) == 0:
        return {"samples": 0}
    return {
        "samples": len(clock.t),
        "realtime_minus_fti_ns": int(clock.offset[0]),
        "realtime_minus_fti_end_ns": int(clock.offset[-1]),
        "steps": [{"t_ns": t_ns, "by_ns": by_ns} for t_ns, by_ns in clock.steps],
        "monotonic_against_oscillator_ppm": clock.slew_ppm,
    }


def _gnss(sync: Sync) -> dict[str, Any] | None:
    """FTI time against GNSS time (source 003, figure 6.10)."""
    clock_series = sync.gnss()
    if clock_series is None:
        return None
    segment = max((s for s in clock_series.clock.segments if s.is_known), key=lambda s: s.last_ns - s.first_ns)
    return {
        "device": clock_series.device.name,
        "scale": clock_series.scale.value,
        "fti_drift_ppm": 1e6 * segment.line.slope,
        "fti_drift_95_ppm": 1e6 * segment.line.slope_95,
        "fti_drift_ms_per_hour": 3.6e6 * segment.line.slope,
    }


# ------------------------------------------------------------------------------------------------------------ text


def as_text(sync: Sync) -> list[str]:
    """Lines of text."""
    note = [f"*** {sync.session_metadata['note']} ***"] if "note" in sync.session_metadata else []
    lines = [line for clock_series in sync.clock_series for line in _device_lines(clock_series, sync.begin_ns)]
    devices = lines or ["no device of this session sends its own time"]
    return [*note, *devices, *_computer_lines(sync), *_gnss_lines(sync)]


def _device_lines(clock_series: DeviceClockSeries, begin_ns: int) -> list[str]:
    refused = f", {clock_series.clock.refused} refused" if clock_series.clock.refused else ""
    count = len(clock_series.clock.segments)
    name, messages = clock_series.device.name, len(clock_series.t_rx)
    head = f"{name}  {clock_series.scale} time, {messages} messages{refused}, {count} segment"
    return [head + ("s" if count > 1 else "")] + [
        line
        for segment in clock_series.clock.segments
        for line in _segment_lines(_segment(clock_series, segment), begin_ns)
    ]


def _segment_lines(entry: dict[str, Any], begin_ns: int) -> list[str]:
    first, last = ((entry[key] - begin_ns) / SECOND_NS for key in ("first_ns", "last_ns"))
    span = f"  {first:.1f} to {last:.1f} s: "
    if not entry["known"]:
        return [f"{span}too few messages"]
    delay = entry["delay_ms"]
    return [
        f"{span}drift {entry['drift_ppm']:+.3f} ppm, 95 % within {entry['drift_95_ppm']:.3f} ({entry['method']})",
        f"    device - FTI {_seconds(entry['offset_ns'])} s +- {entry['offset_sd_ns'] / 1e6:.3f} ms at the start",
        f"    delay beyond the minimum: median {delay['p50']:.2f}, 99 % {delay['p99']:.2f}, "
        f"maximum {delay['max']:.2f} ms; {entry['late']} messages late by more than {entry['late_beyond_ms']:.0f} ms",
    ]


def _computer_lines(sync: Sync) -> list[str]:
    clock = sync.computer
    if len(clock.t) == 0:
        return ["computer  no /fti/clock in this session"]
    lines = [f"computer  real time - FTI {_seconds(int(clock.offset[0]))} s at the start, {len(clock.steps)} steps"]
    lines += [f"  {(t - sync.begin_ns) / SECOND_NS:.1f} s: set by {by / SECOND_NS:+.6f} s" for t, by in clock.steps]
    if clock.slew_ppm is not None:
        lines.append(f"  the kernel slews its clocks by {clock.slew_ppm:+.3f} ppm against the oscillator")
    return lines


def _gnss_lines(sync: Sync) -> list[str]:
    entry = _gnss(sync)
    if entry is None:
        return ["FTI against GNSS  no known clock of GPS or UTC time"]
    drift = f"{entry['fti_drift_ppm']:+.3f} ppm, 95 % within {entry['fti_drift_95_ppm']:.3f}"
    return [f"FTI against GNSS  {drift}: {entry['fti_drift_ms_per_hour']:+.2f} ms an hour (by {entry['device']})"]


def _seconds(t_ns: int) -> str:
    """Nanoseconds as seconds with all digits."""
    return f"{'-' if t_ns < 0 else '+'}{abs(t_ns) // SECOND_NS}.{abs(t_ns) % SECOND_NS:09d}"


# ------------------------------------------------------------------------------------------------------------ plot


def curves(sync: Sync) -> list[dict[str, Any]]:
    """For each known segment: arrival minus device time over FTI time [s], relative to its value at the start [ms].

    line : minimum delay; low, high : the earliest and the latest message around each time
    """
    return [
        _curve(clock_series, s, sync.begin_ns)
        for clock_series in sync.clock_series
        for s in clock_series.clock.segments
        if s.is_known
    ]


def _curve(clock_series: DeviceClockSeries, segment: ClockSegment, begin_ns: int) -> dict[str, Any]:
    t_rx, delay = clock_series.delays(segment)
    line_ms = segment.line.slope * (t_rx - t_rx[0]) / 1e6
    bins = np.unique(np.linspace(0, len(t_rx), BINS + 1).astype(int)[:-1])
    t = (t_rx[bins] - begin_ns) / SECOND_NS
    return {
        "title": f"{clock_series.device.name}: arrival - {clock_series.scale} time",
        "drift": f"{segment.drift_ppm:+.3f} +- {1e6 * segment.line.slope_95:.3f} ppm",
        "t": _round_values(t),
        "line": _round_values(line_ms[bins]),
        "low": _round_values(line_ms[bins] + np.minimum.reduceat(delay, bins) / 1e6),
        "high": _round_values(line_ms[bins] + np.maximum.reduceat(delay, bins) / 1e6),
    }


def _round_values(values: Any) -> list[float]:
    return [round(float(value), 3) for value in values]


def computer_curve(sync: Sync) -> dict[str, Any] | None:
    """Real time - FTI time over FTI time [s], relative to its value at the start [ms]; None without ``/fti/clock``."""
    clock = sync.computer
    if len(clock.t) < 2:
        return None
    samples: Ints = np.unique(np.linspace(0, len(clock.t) - 1, BINS).astype(np.int64))
    moved_ms = (clock.offset[samples] - clock.offset[0]) / 1e6
    return {
        "title": "computer: real time - FTI time",
        "drift": f"{len(clock.steps)} steps",
        "t": _round_values((clock.t[samples] - sync.begin_ns) / SECOND_NS),
        "line": _round_values(moved_ms),
    }


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
    """The plot page: one self-contained HTML file, with uPlot, that loads nothing.  title : of the session"""
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

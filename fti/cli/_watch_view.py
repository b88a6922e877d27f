"""Terminal display of a daemon: one state of ``fti.web.live_state.LiveState`` as rich tables."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from fti.cli._watch_sinks import sinks_table
from fti.constants import SECOND_NS
from fti.terminal_text import escape_tree
from fti.web.live_state import CONTINUOUS, describe_mode

Fields = Mapping[str, Any]

#: Period of the live display [s].
LIVE_PERIOD_S = 0.2
#: Styles of the normal session states; all others are red.
SESSION_STYLES = {"recording": "green", "waiting": "yellow"}
HEIGHT = "/nav/height_above_ground/"
BELOW = "/nav/height_below_aircraft"
INTEGRITY = "/nav/clearance_integrity"
GLIDE = "/nav/glide_slope"
SOLUTION = "/nav/nav_solution"
#: Solutions that replace devices; their altitude is shown.
FALLBACKS = {
    "/nav/filter_solution": "filter",
    "/nav/vertical_solution": "vertical channel",
    "/nav/position_fix": "satellites and DME",
}
#: Position from the ground, which aids the filter.
GROUND = "/nav/terrain_fix"
#: Drift between two looks at the ground, which aids the filter.
DRIFT = "/nav/ground_drift"
#: Solutions with unconfirmed sources.
PROVISIONAL = "/nav/provisional_solution/"
STRUCK_OUT = "strike bright_black"
UNKNOWN = "–"
ALARM_STYLES = {
    "warning": "bold white on red",
    "caution": "bold black on yellow",
    "advisory": "bold black on cyan",
}
QUIET_STYLES = {"warning": "red", "caution": "yellow", "advisory": "cyan"}
LINK_STYLES = {"good": "green", "silent": "yellow", "invalid": "yellow", "wrong rate": "yellow", "overflow": "yellow"}
CLOCK_NAMES = {"gps": "GPS as UTC", "utc": "UTC", "boot": "own"}
CLOCK_STATES = {"learning": "learning: arrival time used", "away": "does not fit: arrival time used"}
INTEGRITY_STYLES = {
    "ok": "bold black on green",
    "monitor": "bold white on blue",
    "caution": "bold black on yellow",
    "alert": "bold white on red",
}


def shown_state(state: Fields) -> dict[str, Any]:
    """The part of a state that is printed as JSON."""
    return {key: state[key] for key in ("health", "hil", "outputs", "alarms", "events")}


def show_live(render_now: Callable[[], RenderableType], once: bool) -> None:
    """Show what is rendered, five times a second, until Ctrl-C; or once."""
    console = Console()
    if once:
        console.print(render_now())
        return
    with Live(console=console, auto_refresh=False, screen=console.is_terminal) as live:
        while True:
            live.update(render_now(), refresh=True)
            time.sleep(LIVE_PERIOD_S)


def render(state: Fields) -> RenderableType:
    """Banner, alarms, emulator, outputs, links, device clocks, and sinks."""
    state = escape_tree(state)
    health = state["health"] or {}
    clocks, sinks = _clocks(health.get("devices", {})), sinks_table(health.get("sinks", {}))
    tables = (_outputs(state["outputs"]), _links(health.get("links", {})), *clocks, *sinks)
    return Group(_banner(health), *_alarms(state["alarms"]), *_laboratory(state["hil"]), *tables)


def _banner(health: Fields) -> Text:
    session, storage = health.get("session", {}), health.get("storage", {})
    origin = str(session.get("origin", UNKNOWN)).upper()
    text = Text()
    text.append(f" {origin} ", "bold" if origin == "FLIGHT" else "bold black on yellow")
    if (mode := str(session.get("mode", CONTINUOUS))) != CONTINUOUS:
        word, explanation = describe_mode(mode)
        text.append(f" {word}: {explanation} ", "bold black on yellow")
    text.append(f"  {session.get('name', UNKNOWN)}  ", "bold")
    state = str(session.get("state", UNKNOWN))
    text.append(state, SESSION_STYLES.get(state, "bold red"))
    size_mb = (storage.get("file_bytes") or 0) / 1e6
    text.append(f"  {size_mb:.1f} MB, {_number(storage.get('free_mb'), 0)} MB free")
    if delay := health.get("navigation", {}).get("output_delay"):
        text.append(f"  outputs p50 {_number(delay['p50_ms'], 0)}, p99 {_number(delay['p99_ms'], 0)} ms")
    return text


def _alarms(alarms: list[Fields]) -> Iterator[Text]:
    """The alarms with their times; an acknowledged or ended alarm is not bold."""
    for alarm in alarms:
        is_urgent = alarm["end_ns"] is None and not alarm["is_acknowledged"]
        style = (ALARM_STYLES if is_urgent else QUIET_STYLES).get(alarm["severity"], "")
        more = f" (+{len(alarm['consequences'])})" if alarm["consequences"] else ""
        yield Text(f" {alarm['title']}{more} – {alarm['cause']} – {describe_times(alarm)} ", style)
    if any(not alarm["is_acknowledged"] for alarm in alarms):
        yield Text(" acknowledge with: fti acknowledge", "dim")


def _laboratory(hil: Fields | None) -> Iterator[Text]:
    """The status of an emulator; nothing without one, struck out when its status is late."""
    if hil is None:
        return
    late, style = hil["lateness"], STRUCK_OUT if hil["late"] else ""
    text = Text(" LABORATORY ", "bold black on yellow")
    text.append(f"  {hil['scenario']}, {_number(hil['flight_s'], 0)} s of {_number(hil['duration_s'], 0)} s", style)
    text.append(f"  late p50 {_number(late['p50_ms'], 1)}, p99 {_number(late['p99_ms'], 1)} ms", style)
    held = "rates held" if hil["holds"] else f"rates of {len(hil['not_held'])} devices not held"
    text.append(f"  {held}", style or ("green" if hil["holds"] else "yellow"))
    yield text.append(f"  SILENT for {hil['age_ms'] / 1000:.0f} s", "red") if hil["late"] else text
    troubles = [
        f"{name} {str(device['breaker']).upper().replace('_', ' ')}"
        for name, device in hil["devices"].items()
        if device["breaker"] not in (None, "on")
    ]
    for fault in hil["faults"]:
        on = f"{', '.join(fault['on'])}: " if fault["on"] else ""
        until = f" until {_number(fault['until_s'], 0)} s" if fault["until_s"] is not None else ""
        troubles.append(f"{on}{fault['words']}{until}")
    if troubles:
        yield Text("   " + "; ".join(troubles), style or "yellow")


def _outputs(outputs: Fields) -> Table:
    table = Table("output", "value", "sigma", "", "", expand=True, box=None, header_style="dim")
    if below := outputs.get(BELOW):
        by = f"by {below['sensor']}" + (f", {compensation}" if (compensation := below["compensation"]) else "")
        _add(table, "height below aircraft", below, (_metres(below["height_agl"], 1), _sigma(below["sd"], "m"), by))
    for topic, output in outputs.items():
        if topic.startswith(HEIGHT):
            values = (_metres(output["height_agl"], 1), _sigma(output["sd"], "m"), f"raw {_metres(output['raw'], 1)}")
            _add(table, f"  {topic.removeprefix(HEIGHT)}", output, values)
            if ground := _over_ground(output):
                table.add_row(Text("    nearest return", "dim"), *ground)
    if integrity := outputs.get(INTEGRITY):
        _add_integrity(table, integrity)
    if glide := outputs.get(GLIDE):
        deviation = f"{_number(_degrees(glide['deviation']), 2, '+')}°, {_metres(glide['dh'], 1, '+')}"
        values = (deviation, _sigma(_degrees(glide["sd"]), "°"), f"{_metres(glide['s'], 0)} to go")
        _add(table, "glide slope", glide, values)
    if solution := outputs.get(SOLUTION):
        _add_solution(table, solution)
    for topic, name in FALLBACKS.items():
        if found := outputs.get(topic):
            sigma = _sigma(found.get("vertical_sd"), "m")
            source = str(found.get("mode") or found.get("altitude_source") or found.get("altimeter") or "")
            _add(table, name, found, (_metres(found["alt"], 1), sigma, source))
    _add_by_ground(table, outputs)
    # The offset of the filter with each unconfirmed source; a late solution has ended and is left out.
    for topic, found in outputs.items():
        if topic.startswith(PROVISIONAL) and not found["late"]:
            offset = f"{_metres(found['distance'], 0)} off, height {_metres(found['height_difference'], 0, '+')}"
            values = (offset, _sigma(found["horizontal_sd"], "m"), f"HPL {_metres(found['hpl'], 0)}")
            _add(table, f"  {topic.removeprefix(PROVISIONAL)}, provisional", found, values)
    return table


def _add_by_ground(table: Table, outputs: Fields) -> None:
    """Position and drift that the ground gives."""
    for topic, add in ((GROUND, _add_ground), (DRIFT, _add_drift)):
        if found := outputs.get(topic):
            add(table, found)


def _add_ground(table: Table, output: Fields) -> None:
    """The fix of the last profile: its distance from the filter, its sigma, and its samples."""
    has_place = all(output[name] is not None for name in ("north_sd", "east_sd", "shift_north", "shift_east"))
    offset = f"{_metres(math.hypot(output['shift_north'], output['shift_east']), 0)} off" if has_place else UNKNOWN
    sigma = _sigma(max(output["north_sd"], output["east_sd"]), "m") if has_place else ""
    kind = "frames of beams" if output["method"] == "beams" else "heights"
    samples = "" if output["samples"] is None else f"{output['samples']} {kind}"
    _add(table, "position from the ground", output, (offset, sigma, samples))


def _add_drift(table: Table, output: Fields) -> None:
    """The drift between the last two looks: its length, its sigma, the overlap and the pairs that did not aid."""
    is_whole = all(output[name] is not None for name in ("north", "east", "north_sd", "east_sd"))
    drift = _metres(math.hypot(output["north"], output["east"]), 2) if is_whole else UNKNOWN
    sigma = _sigma(max(output["north_sd"], output["east_sd"]), "m") if is_whole else ""
    overlap = "" if output["overlap"] is None else f"overlap {_number(100.0 * output['overlap'], 0)} %"
    pairs = "" if output["pairs"] is None else f"{output['refused']} of {output['pairs']} pairs refused"
    _add(table, "drift over the ground", output, (drift, sigma, ", ".join(filter(None, (overlap, pairs)))))


def _over_ground(output: Fields) -> tuple[str | Text, ...]:
    """Measured and predicted range, or why there is none; nothing where the daemon does not publish them."""
    unchecked = output.get("unchecked_text", ())
    words = Text(", ".join(word for word in (output.get("compensation"), *unchecked) if word), "dim")
    if output.get("nearest") is None:
        return (UNKNOWN, "", "", words) if unchecked else ()
    predicted = f"predicts {_metres(output['predicted'], 1)}" if output.get("predicted") is not None else ""
    return _metres(output["nearest"], 1), _sigma(output["nearest_sd"], "m"), predicted, words


def _add(table: Table, name: str, output: Fields, values: tuple[str, str, str]) -> None:
    style = "" if output["valid"] else STRUCK_OUT
    table.add_row(Text(name, "bold"), *(Text(value, style) for value in values), _validity(output))


def _add_solution(table: Table, output: Fields) -> None:
    """Sources of position, altitude and attitude, sigmas and protection levels; missing: a dash, late: struck out."""
    style, validity = STRUCK_OUT if output["late"] else "", _validity(output)
    altitude = _metres(output.get("alt"), 1)
    roles = (("position", "", "horizontal_sd"), ("altitude", altitude, "vertical_sd"), ("attitude", "", ""))
    levels = {
        "position": f", HPL {_metres(output['hpl'], 0)}" if output.get("hpl") is not None else "",
        "altitude": f", VPL {_metres(output['vpl'], 0)}" if output.get("vpl") is not None else "",
        "attitude": "".join(
            f", {name} {math.degrees(level):.1f}°"
            for name, level in (("tilt PL", output.get("tilt_pl")), ("heading PL", output.get("heading_pl")))
            if level is not None
        ),
    }
    for role, value, sigma in roles:
        source = f"from {output.get(f'{role}_source') or UNKNOWN}{levels.get(role, '')}"
        cells = (value, _sigma(output.get(sigma), "m"), source)
        table.add_row(Text(role, "bold"), *(Text(text, style) for text in cells), validity)
        validity = Text()


def _validity(output: Fields) -> Text:
    if output["late"]:
        return Text(f"STALE {output['age_ms'] / 1000:.1f} s", "red")
    reasons = ", ".join(output["reasons_text"])
    return Text(reasons or "valid", "green" if output["valid"] else "yellow")


def _add_integrity(table: Table, output: Fields) -> None:
    late = output["late"]
    state = Text(
        f" {str(output['state']).upper()} ", STRUCK_OUT if late else INTEGRITY_STYLES.get(output["state"], "bold")
    )
    ratios = " ".join(f"T{i} {_number(output[f't{i}_ratio'], 2)}" for i in range(1, 5))
    words = ", ".join(output["reasons_text"]) or output["state_text"]
    validity = _validity(output) if late else Text(words)
    table.add_row(Text("integrity", "bold"), state, "", Text(ratios, STRUCK_OUT if late else ""), validity)


def _links(links: Fields) -> Table:
    table = Table("link", "state", "frames/s", "bytes", "dropped", "hint", expand=True, box=None, header_style="dim")
    for name, link in links.items():
        dropped = link.get("dropped_frames", 0)
        table.add_row(
            Text(name, "bold"),
            Text(link["state"], LINK_STYLES.get(link["state"], "red")),
            _number(link.get("rate_hz"), 1),
            f"{link.get('bytes', 0):,}",
            Text(str(dropped), "bold red" if dropped else ""),
            _remarks(link),
        )
    return table


def _remarks(link: Fields) -> Text:
    """Hint of a link, and the error counters of its UART or CAN controller."""
    errors = (link.get("ledger") or {}).get("errors") or {}
    counts = ", ".join(f"{name} {count}" for name, count in errors.items() if count)
    parts = [(text, style) for text, style in ((link.get("hint") or "", "dim"), (counts, "yellow")) if text]
    return Text("  ", overflow="ellipsis").join(Text(text, style) for text, style in parts)


def _clocks(devices: Fields) -> Iterator[Table]:
    """Each device clock against FTI time; nothing while no device has sent its time."""
    table = Table("clock of", "", "offset", "drift", "late", "", expand=True, box=None, header_style="dim")
    for name, device in devices.items():
        for clock in device.get("clocks", []):
            good = clock["state"] == "good"
            figures = _clock_figures(clock) if good else ("", "", "")
            state = CLOCK_STATES.get(clock["state"], str(clock["state"]))
            words = state if not good else "" if clock["used"] else "not used (use_device_time = false)"
            style = "yellow" if clock["state"] == "away" else "dim"
            table.add_row(Text(name, "bold"), CLOCK_NAMES.get(clock["scale"], ""), *figures, Text(words, style))
    if table.row_count:
        yield table


def _clock_figures(clock: Fields) -> tuple[str, str, str]:
    """Offset, drift, share of late messages; for a clock that counts from power-on, the time of power-on."""
    drift = f"{_number(clock['drift_ppm'], 2, '+')} ± {_number(clock['drift_sd_ppm'], 2)} ppm"
    offset = f"{_number(clock['offset_ms'], 2, '+')} ± {_number(clock['offset_sd_ms'], 2)} ms"
    if clock["scale"] == "boot":
        offset = f"on at {_time_of_day(clock['offset_ms'])}"
    share = clock["late_share"]
    return offset, drift, f"{_number(share and 100 * share, 1)} %"


def _time_of_day(offset_ms: float | None) -> str:
    """UTC at which a clock with this offset [ms] began to count."""
    try:
        return f"{datetime.fromtimestamp(-(math.nan if offset_ms is None else offset_ms) / 1000, UTC):%H:%M:%S.%f}"[:-3]
    except (ValueError, OverflowError):  # unknown, or out of range
        return UNKNOWN


def _number(value: object, digits: int, sign: str = "") -> str:
    return f"{value:{sign}.{digits}f}" if isinstance(value, int | float) else UNKNOWN


def _metres(value: object, digits: int, sign: str = "") -> str:
    return f"{_number(value, digits, sign)} m"


def _sigma(value: object, unit: str) -> str:
    return f"± {_number(value, 2)} {unit}" if isinstance(value, int | float) else ""


def _degrees(value: object) -> float | None:
    return math.degrees(value) if isinstance(value, int | float) else None


def describe_times(alarm: Mapping[str, Any]) -> str:
    """Begin, duration, count and acknowledgement of an alarm."""
    begin = f"{datetime.fromtimestamp(alarm['begin_ns'] // SECOND_NS, UTC):%H:%M:%S}"
    if alarm["end_ns"] is None:
        parts = [f"since {begin}"]
    else:
        parts = [f"{begin}, ended after {(alarm['end_ns'] - alarm['begin_ns']) / SECOND_NS:.1f} s"]
    if alarm["count"] > 1:
        parts.append(f"{alarm['count']} times")
    if alarm["acknowledged_by"]:
        parts.append(f"acknowledged by {alarm['acknowledged_by']}")
    return ", ".join(parts)

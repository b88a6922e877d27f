"""Text output of ``fti check`` for a configuration: one item per line, name first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fti.cli._check_sinks import sink_cells
from fti.cli._terrain_files import layer_cells, terrain_cells


def lines(description: dict[str, Any]) -> Iterator[str]:
    """The lines of a description that ``check.describe`` returns."""
    session = description["session"]
    yield f"{description['config']}: good"
    yield (
        f"session {session['name']} -> {session['directory']}; a new file every {session['split_s']:g} s or "
        f"{session['split_mb']:g} MB; {session['min_free_mb']:g} MB stay free"
    )
    if snapshot := description["snapshot"]:
        also = "; the links are recorded only on a trigger" if session["mode"] == "snapshot" else ""
        yield (
            f"snapshot from {snapshot['before_s']:g} s before a trigger to {snapshot['after_s']:g} s after it{also}; "
            f"{snapshot['max_mb']:g} MB hold {snapshot['holds_s']:g} s of all links at their full rates"
        )
    tables: dict[str, list[tuple[str, ...]]] = {
        "storage": [
            (p["role"], p["directory"], f"on {p['medium']}", p["fault"] or f"{p['free_mb']:.0f} MB free")
            for p in description["storage"]
        ],
        "links": [_link_cells(link) for link in description["links"]],
        "devices": [_device_cells(device) for device in description["devices"]],
        "roles": list(_role_cells(description)),
    }
    if description["terrain"]:
        tables["terrain"] = [terrain_cells(file) for file in description["terrain"]]
        tables["terrain error"] = [layer_cells(layer) for layer in description["terrain_layers"]]
    if description["land_cover"]:
        tables[f"land cover of {description['land_cover']['file']}"] = [
            _cover_cells(cover) for cover in description["land_cover"]["cover"]
        ]
    if description["sinks"]:
        tables["sinks"] = [sink_cells(sink) for sink in description["sinks"]]
    for title, rows in tables.items():
        yield title
        yield from table_lines(rows)
    for warning in description["warnings"]:
        yield f"warning: {description['config']}: {warning}"
    for hint in description["hints"]:
        yield f"hint: {hint}"
    if "live" in description:
        yield "now"
        yield from table_lines(
            [
                (name, link["state"], f"{link['frames']} frames, {link['bytes']} bytes", link["hint"])
                for name, link in description["live"].items()
            ]
        )


def _link_cells(link: dict[str, Any]) -> tuple[str, ...]:
    devices = ", ".join(link["devices"]) or "(recorded, not decoded)"
    sends = "may send" if link["transmit"] else "listens"
    stall = f"survives {link['stall_s']:g} s without storage ({link['stall_at']})"
    return (link["name"], link["kind"], link["port"], sends, stall, devices)


def _device_cells(device: dict[str, Any]) -> tuple[str, ...]:
    rate = f"{device['rate_hz']:g} Hz" if device["rate_hz"] else "any rate"
    age = f"stale after {device['max_age_ms']:g} ms"
    time = "" if device["use_device_time"] else "valid at arrival, device time not used"
    return (device["name"], f"on {device['link']}", device["driver"], rate, age, time)


def _role_cells(description: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    reasons = {m["role"]: m["reason"] for m in description["missing"]}
    named = {role: ", ".join(names) for role, names in description["roles"].items()}
    for role, names in {**named, "approach": description["approach"]}.items():
        effect = f"outputs that need it stay invalid ({reasons[role]})" if role in reasons else ""
        yield (role, f"{names or 'none'}: {effect}" if effect else names)
    for role, name in (("filter", "filter"), ("ground", "terrain_position"), ("drift", "scan_drift")):
        if description[name]:
            yield (role, description[name])


def _cover_cells(cover: dict[str, Any]) -> tuple[str, ...]:
    classes = ", ".join(str(number) for number in cover["classes"])
    measures = f"{cover['bias_m']:g} m above the elevation, sigma {cover['sd_m']:g} m"
    return (f"class {classes}", cover["altimeter"], "no sample is used" if cover["excluded"] else measures)


def table_lines(rows: list[tuple[str, ...]]) -> Iterator[str]:
    """Rows of equal length as indented columns; "none" without rows."""
    if not rows:
        yield "  none"
        return
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()

"""What ``fti check`` has found, for people: one thing per line, name first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fti.cli._terrain_files import layer_cells, terrain_cells


def lines(found: dict[str, Any]) -> Iterator[str]:
    """The lines of a description as ``check.describe`` gives it."""
    session = found["session"]
    yield f"{found['config']}: good"
    yield (
        f"session {session['name']} -> {session['directory']}; a new file every {session['split_s']:g} s or "
        f"{session['split_mb']:g} MB; {session['min_free_mb']:g} MB stay free"
    )
    if shot := found["snapshot"]:
        also = "; nothing but this is recorded of the links" if session["mode"] == "snapshot" else ""
        yield (
            f"snapshot from {shot['before_s']:g} s before a trigger to {shot['after_s']:g} s after it{also}; "
            f"{shot['max_mb']:g} MB hold {shot['holds_s']:g} s of all links at their full rates"
        )
    tables = {
        "storage": [_place_cells(place) for place in found["storage"]],
        "links": [_link_cells(link) for link in found["links"]],
        "devices": [_device_cells(device) for device in found["devices"]],
        "roles": list(_role_cells(found)),
    }
    if found["terrain"]:
        tables["terrain"] = [terrain_cells(file) for file in found["terrain"]]
        tables["error of the terrain"] = [layer_cells(layer) for layer in found["terrain_layers"]]
    for title, rows in tables.items():
        yield title
        yield from table_lines(rows)
    for warning in found["warnings"]:
        yield f"warning: {warning}"
    for hint in found["hints"]:
        yield f"hint: {hint}"
    if "live" in found:
        yield "now"
        yield from table_lines([_live_cells(name, link) for name, link in found["live"].items()])


def _live_cells(name: str, link: dict[str, Any]) -> tuple[str, ...]:
    return (name, link["state"], f"{link['frames']} frames, {link['bytes']} bytes", link["hint"])


def _place_cells(place: dict[str, Any]) -> tuple[str, ...]:
    space = place["fault"] or f"{place['free_mb']:.0f} MB free"
    return (place["role"], place["directory"], f"on {place['medium']}", space)


def _link_cells(link: dict[str, Any]) -> tuple[str, ...]:
    devices = ", ".join(link["devices"]) or "(recorded, not decoded)"
    sends = "may send" if link["transmit"] else "listens"
    stall = f"survives {link['stall_s']:g} s without storage ({link['stall_at']})"
    return (link["name"], link["kind"], link["port"], sends, stall, devices)


def _device_cells(device: dict[str, Any]) -> tuple[str, ...]:
    rate = f"{device['rate_hz']:g} Hz" if device["rate_hz"] else "any rate"
    age = f"stale after {device['max_age_ms']:g} ms"
    time = "" if device["use_device_time"] else "valid as of its arrival, whatever time it says itself"
    return (device["name"], f"on {device['link']}", device["driver"], rate, age, time)


def _role_cells(found: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    reasons = {m["role"]: m["reason"] for m in found["missing"]}
    named = {role: ", ".join(names) for role, names in found["roles"].items()}
    for role, what in {**named, "approach": found["approach"]}.items():
        useless = f"what needs it stays invalid ({reasons[role]})" if role in reasons else ""
        yield (role, f"{what or 'none'}: {useless}" if useless else what)


def table_lines(rows: list[tuple[str, ...]]) -> Iterator[str]:
    """Rows of equal length as indented columns; "none" where there are no rows."""
    if not rows:
        yield "  none"
        return
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()

"""Sessions as recipes, written by the official ``mcap`` writer.

Nothing here uses the product's writer.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

BEGIN = 1_767_323_045_000_000_000
STEP = 20_000_000
NAME = "s_20260102T030405Z_0"
CONFIG = """
[session]
name = "s"
directory = "data"

[[link]]
name = "gnss"
kind = "udp"
bind = "127.0.0.1:47123"

[[device]]
name = "gnss"
link = "gnss"
driver = "nmea0183"
rate_hz = 5
max_age_ms = 1000

[nav]
position = ["gnss"]
"""
NMEA = b"$GNGGA,030405.00,4754.00000,N,01148.00000,E,1,10,0.9,600.0,M,47.0,M,,*"


@dataclass
class Message:
    """One message of a file."""

    topic: str
    t: int
    data: bytes
    sequence: int = 0
    encoding: str = "json"
    published: int | None = None


@dataclass
class File:
    """What a file is to hold."""

    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    messages: list[Message]
    compression: CompressionType = CompressionType.NONE
    chunk_size: int = 2**16


@dataclass
class Session:
    """The files of a folder, by name; ``after`` changes what was written."""

    files: dict[str, File]
    after: list[Callable[[Path], None]] = field(default_factory=list)


def session() -> Session:
    """A session that every command can read: raw, derived and truth, half a minute at 5 Hz."""
    about = {"fti": {"name": "s", "origin": "hil", "software": "0.1.0", "mode": "continuous"}}
    attached = {"config.toml": CONFIG.encode()}

    def kind(of: str) -> dict[str, dict[str, str]]:
        return {"fti.file": {"kind": of, "session": NAME}, **about, "fti.links": {"gnss": "udp"}}

    return Session(
        {
            f"{NAME}_000.mcap": File(kind("raw"), dict(attached), list(_raw())),
            f"{NAME}_derived_000.mcap": File(kind("derived"), dict(attached), list(_derived())),
            f"{NAME}_truth_000.mcap": File(kind("truth"), {"scenario.json": _flight_recipe()}, list(_truth())),
        }
    )


def _flight_recipe() -> bytes:
    from fti.hil import scenario as scenarios

    return scenarios.load(scenarios.find("silence")).flight_key.encode()


def _times() -> list[int]:
    return [BEGIN + k * STEP for k in range(150)]


def _note(topic: str, t: int, table: Any) -> Message:
    return Message(topic, t, json.dumps(table).encode())


def _raw() -> list[Message]:
    found, seq = list[Message](), 0
    for k, t in enumerate(_times()):
        checked = NMEA + b"%02X\r\n" % _xor(NMEA)
        found.append(Message("/raw/gnss", t, checked, seq, "x-fti-raw"))
        found.append(Message("/fti/tick", t, b"", seq + 1, "x-fti-raw"))
        seq += 2
        if k % 50 == 0:
            clock = {"t_ns": t, "monotonic_ns": k, "monotonic_raw_ns": t + 5, "realtime_ns": t + 7, "width_ns": 100}
            found.append(_note("/fti/clock", t, clock))
            found.append(_note("/fti/ledger", t, _ledger(t, k + 1, seq)))
            found.append(_note("/fti/health", t, HEALTH))
            found.append(_note("/fti/event", t, {"level": 3, "name": "mark", "message": "begin"}))
    gap = {"kind": "buffer_overflow", "link": "gnss", "first_seq": 3, "last_seq": 5, "frames": 1}
    return [*found, _note("/fti/gap", BEGIN, gap)]


def _xor(line: bytes) -> int:
    total = 0
    for byte in line[1:-1]:
        total ^= byte
    return total


def _ledger(t: int, frames: int, seq: int) -> dict[str, Any]:
    size = frames * (len(NMEA) + 4)
    none = {f"{part}_{what}": 0 for part in ("in", "recorded", "held") for what in ("frames", "bytes")}
    account = {**none, "in_frames": frames, "in_bytes": size, "recorded_frames": frames, "recorded_bytes": size}
    ticks = {**none, "in_frames": frames, "recorded_frames": frames, "dropped": {}}
    link = {**account, "dropped": {}, "sent": {**none, "dropped": {}}, "errors": {}}
    recorder = {"pid": 7, "started_ns": BEGIN, "first_seq": 0}
    return {"t_ns": t, "recorder": recorder, "next_seq": seq, "final": False, "ticks": ticks, "links": {"gnss": link}}


HEALTH: dict[str, Any] = {
    "t_ns": BEGIN,
    "devices": {"gnss": {"state": "good", "clocks": [{"drift_ppm": 1.0, "state": "good"}], "skipped": {"pause": 1}}},
    "links": {"gnss": {"state": "good"}},
    "navigation": {"lag_ms": 3.0},
}


def _derived() -> list[Message]:
    found = [
        _note("/fti/terrain", BEGIN, {"t_ns": BEGIN, "after_seq": 3, "name": "flat", "sha256": "00"}),
        _note("/fti/gap", BEGIN, {"kind": "overrun", "t_ns": BEGIN, "after_seq": 3, "before_seq": 5}),
        _note("/fti/device_clock", BEGIN, {"t_ns": BEGIN, "clocks": {}, "gnss": _gnss_time()}),
    ]
    for k, t in enumerate(_times()):
        height = {"t_valid_ns": t, "raw": 100.0 + k, "predicted": 100.5 + k, "height_agl": 100.0, "valid": True}
        found.append(_note("/nav/height_above_ground/altimeter", t, {**height, "reasons": [], "unchecked": []}))
        place = {"t_valid_ns": t, "lat": 0.83, "lon": 0.2, "alt": 700.0, "roll": 0.0, "pitch": 0.0, "valid": True}
        sources: dict[str, Any] = {
            "position_source": "gnss",
            "attitude_source": None,
            "altitude_source": "gnss",
            "reasons": [],
        }
        found.append(_note("/nav/nav_solution", t, {**place, **sources}))
        found.append(_note("/gnss/position", t, {"t_valid_ns": t, "lat": 0.83, "valid": False, "flags": ["x"]}))
        found.append(_note("/gnss/device_status", t, {"ok": k % 2 == 0, "flags": ["x"]}))
    return found


def _gnss_time() -> dict[str, Any]:
    return {"device": "gnss", "scale": "utc", "time_ns": BEGIN + 9}


def _truth() -> list[Message]:
    row = {
        "height_agl": 300.0,
        "s": 1000.0,
        "y": 0.0,
        "roll": 0.0,
        "pitch": 0.0,
        "vel_down": 3.0,
        "range_altimeter": 2.0,
    }
    return [_note("/truth/state", t, row) for t in _times()]


# ------------------------------------------------------------------------------------------------------------- writing


def write(recipe: Session, folder: Path) -> Path:
    """The session folder, below ``folder``."""
    place = folder / NAME
    place.mkdir(parents=True)
    for name, file in recipe.files.items():
        with (place / name).open("wb") as stream:
            _write(file, Writer(stream, file.chunk_size, file.compression))
    for change in recipe.after:
        change(place)
    return place


def _write(file: File, writer: Writer) -> None:
    writer.start("fti", "hostile")
    for name, data in file.attachments.items():
        writer.add_attachment(0, 0, name, "text/plain", data)
    for name, table in file.metadata.items():
        writer.add_metadata(name, table)
    schema = writer.register_schema("x", "jsonschema", b"{}")
    ids: dict[str, int] = {}
    for m in file.messages:
        if m.topic not in ids:
            ids[m.topic] = writer.register_channel(m.topic, m.encoding, schema if m.encoding == "json" else 0)
        writer.add_message(ids[m.topic], m.t, m.data, m.t if m.published is None else m.published, m.sequence)
    writer.finish()  # type: ignore[no-untyped-call]

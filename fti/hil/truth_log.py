"""The truth of a simulated flight as MCAP: topic ``/truth/state``, JSON, 25 Hz.

Log time is the instant of a row, publish time when it was written: how late the emulator was, as everything it sent.
Topic ``/truth/end`` has the last message: how many rows there are, and what was sent on each link.
Topic ``/truth/late`` has when the kernel was late with what the emulator had sent: log time when, publish time until.
The file says which scenario was flown (attachment ``scenario.json``), whether in real time or faster (metadata
``flight``), with which configuration (its text and the texts that it names are attached as to a session), and how often
each device sends each kind of measurement (``sent_rates.json``).  What each device means to state once a second is on
``/truth/measurement/<device>``, at the time of the sample.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fti.config import Device
from fti.hil.environment import Environment
from fti.hil.ports.counters import EndpointCounters
from fti.hil.sensors.intended_values import IntendedValues
from fti.logger.stream_writer import StreamWriter

RATE_HZ = 25.0
FLUSH_EVERY = 5
SECOND_NS = 1_000_000_000
TOPIC, LATE_TOPIC, END_TOPIC = "/truth/state", "/truth/late", "/truth/end"
MEASUREMENT = "/truth/measurement/"
SCENARIO_ATTACHMENT, RATES_ATTACHMENT = "scenario.json", "sent_rates.json"
#: Metadata of the file, and what it says: "true" or "false".
FLIGHT_METADATA, REAL_TIME_KEY = "flight", "real_time"
#: Nobody knows better where an aircraft is [m]: ``range_bounds`` of the world.
POSITION_TOLERANCE_M = 3.0
QUANTITIES = {
    "lat": "latitude [rad]",
    "lon": "longitude [rad]",
    "alt": "height of P above the WGS84 ellipsoid [m]",
    "alt_msl": "height of P above mean sea level [m]",
    "vel_north": "[m/s]",
    "vel_east": "[m/s]",
    "vel_down": "[m/s]",
    "ground_speed": "[m/s]",
    "roll": "right wing down [rad]",
    "pitch": "nose up [rad]",
    "heading": "clockwise from true north [rad]",
    "tas": "true airspeed [m/s]",
    "s": "path length before the glide path intercept point [m]",
    "y": "offset right of the track [m]",
    "height_agl": "height of P above the surface below it [m]",
    "dh": "height above the glide path [m]",
    "deviation": "angle above the glide path as seen from its intercept point [rad]; left out behind it",
}
#: Of each altimeter, before its name.
RANGES = {
    "range_": "of this altimeter's beam, without noise [m]; left out where it meets nothing",
    "least_range_": f"the least within {POSITION_TOLERANCE_M:g} m of the place, in the same attitude [m]",
    "most_range_": "the largest [m]",
}


_INTENDED_SCHEMA = {
    "type": "object",
    "title": "fti.IntendedValues",
    "properties": {
        "t_ns": {"type": "integer", "description": "FTI time of the sample [ns]"},
        "values": {
            "type": "object",
            "description": "by measurement, its name in brackets, and field; SI and radians, before faults",
            "additionalProperties": {"type": "number"},
        },
    },
}


class TruthRows:
    """What stands in the truth file of one flight; everything is computed before the flight begins.

    That takes a second of a core, in which whoever comes before others would keep others from theirs.
    """

    def __init__(
        self,
        world: Environment,
        altimeters: Sequence[Device] = (),
        rates: Mapping[str, Mapping[str, float]] | None = None,
        intended: Sequence[IntendedValues] = (),
    ) -> None:
        self.altimeters, self.flown = altimeters, world.scenario.flown
        self.rates, self.intended = rates or {}, intended
        self.t = np.arange(0.0, world.duration, 1.0 / RATE_HZ)
        self._columns = _columns(world, self.t)
        for device in altimeters:
            around = world.range_bounds(self.t, device, POSITION_TOLERANCE_M)
            self._columns |= {begin + device.name: column for begin, column in zip(RANGES, around, strict=True)}

    @property
    def columns(self) -> Mapping[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
        """Every column by its name, shape (n,) as ``t``; NaN where a value is unknown."""
        return self._columns

    def row(self, k: int) -> dict[str, float]:
        """What is known of row k."""
        known = {name: float(column[k]) for name, column in self._columns.items()}
        return {name: value for name, value in known.items() if math.isfinite(value)}


class TruthLog:
    """The truth file of one flight.

    real_time : the bench's, not a clock that jumps; texts : the configuration that is played, by names of attachments
    """

    def __init__(
        self, path: Path, rows: TruthRows, *, real_time: bool = True, texts: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self._rows = rows
        path.parent.mkdir(parents=True, exist_ok=True)
        self._writer = StreamWriter(path)
        self._writer.add_attachment(SCENARIO_ATTACHMENT, "application/json", rows.flown.encode(), log_time=0)
        rates_json = json.dumps(rows.rates).encode()
        self._writer.add_attachment(RATES_ATTACHMENT, "application/json", rates_json, log_time=0)
        for name, text in texts.items():
            self._writer.add_attachment(name, "text/plain", text.encode(), log_time=0)
        self._writer.add_metadata(FLIGHT_METADATA, {REAL_TIME_KEY: str(real_time).lower()})
        schema = self._writer.add_schema("fti.Truth", "jsonschema", json.dumps(_schema(rows.altimeters)).encode())
        self._channel = self._writer.add_channel(TOPIC, "json", schema)
        values = self._writer.add_schema("fti.IntendedValues", "jsonschema", json.dumps(_INTENDED_SCHEMA).encode())
        self._device_channels = {
            device: self._writer.add_channel(f"{MEASUREMENT}{device}", "json", values)
            for device in dict.fromkeys(one.device for one in rows.intended)
        }
        self._written = 0
        self._late_channel = self._writer.add_channel(LATE_TOPIC, "json")
        self._end_channel = self._writer.add_channel(END_TOPIC, "json")
        self._count, self._last_ns = 0, 0

    def stream(self, start_ns: int, now_ns: Callable[[], int]) -> TruthStream:
        """The rows as a stream of the scheduler, for a flight that begins at start_ns; now_ns : FTI time [ns]."""
        return TruthStream(self, self._rows.t, start_ns, now_ns)

    def write(self, k: int, start_ns: int, now_ns: int) -> None:
        """Write row k of a flight that began at start_ns, at now_ns."""
        t_ns = start_ns + round(float(self._rows.t[k]) * SECOND_NS)
        row = {"t_ns": t_ns, **self._rows.row(k)}
        self._writer.write(self._channel, t_ns, json.dumps(row).encode(), k, now_ns)
        self._count, self._last_ns = self._count + 1, t_ns
        self._write_intended(float(self._rows.t[k]), start_ns, now_ns)
        if k % FLUSH_EVERY == 0:
            self._writer.flush()

    def _write_intended(self, until_s: float, start_ns: int, now_ns: int) -> None:
        """Write what devices have meant to state until a time of the flight."""
        intended = self._rows.intended
        while self._written < len(intended) and intended[self._written].t_s <= until_s:
            one = intended[self._written]
            t_ns = start_ns + round(one.t_s * SECOND_NS)
            content = json.dumps({"t_ns": t_ns, "values": one.values}).encode()
            self._writer.write(self._device_channels[one.device], t_ns, content, self._written, now_ns)
            self._written += 1

    def note_late(self, from_ns: int, until_ns: int) -> None:
        """What was sent at from_ns came out of this machine's port at until_ns."""
        text = json.dumps({"from_ns": from_ns, "until_ns": until_ns})
        self._writer.write(self._late_channel, from_ns, text.encode(), publish_time=until_ns)

    def note_end(self, sent: Mapping[str, EndpointCounters]) -> None:
        """The flight has ended, here or because it was stopped.  sent : of each link"""
        links = {name: {"messages": one.messages, "bytes": one.bytes} for name, one in sent.items()}
        text = json.dumps({"rows": self._count, "sent": links})
        self._writer.write(self._end_channel, self._last_ns, text.encode(), publish_time=self._last_ns)

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()


class TruthStream:
    """Rows of the truth at their instants."""

    def __init__(
        self,
        log: TruthLog,
        t: np.ndarray[tuple[int], np.dtype[np.float64]],
        start_ns: int,
        now_ns: Callable[[], int],
    ) -> None:
        self._log, self._t, self._start_ns, self._now_ns = log, t, start_ns, now_ns
        self._k = 0

    def due_s(self) -> float | None:
        """Instant of the next row."""
        return float(self._t[self._k]) if self._k < len(self._t) else None

    async def send(self) -> None:
        """Write the row."""
        self._log.write(self._k, self._start_ns, self._now_ns())
        self._k += 1


def _schema(altimeters: Sequence[Device]) -> dict[str, object]:
    ranges = {begin + device.name: text for device in altimeters for begin, text in RANGES.items()}
    return {
        "type": "object",
        "title": "fti.Truth",
        "properties": {
            "t_ns": {"type": "integer", "description": "FTI time [ns]"},
            **{name: {"type": "number", "description": text} for name, text in (QUANTITIES | ranges).items()},
        },
    }


def _columns(world: Environment, t: np.ndarray[tuple[int], np.dtype[np.float64]]) -> dict[str, np.ndarray]:
    now = world.state(t)
    path = world.path
    s, y = path.along(now.lat, now.lon)
    dh = now.alt - path.alt_path(s)
    deviation = np.where(s > 0.0, np.arctan2(s * math.tan(path.glide) + dh, s) - path.glide, np.nan)
    north, east, down = now.vel_n.T
    values = (
        now.lat, now.lon, now.alt, now.alt - world.undulation, north, east, down, np.hypot(north, east),
        now.roll, now.pitch, now.heading, now.tas, s, y, now.alt - world.ground(now), dh, deviation,
    )  # fmt: skip
    return dict(zip(QUANTITIES, values, strict=True))

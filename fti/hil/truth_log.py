"""The ground truth of a simulated flight as MCAP: topic ``/truth/state``, JSON, 25 Hz.

Log time is the time of a row, publish time when it was written; the difference is the lateness of the emulator.
Topic ``/truth/end`` has the last message: number of rows, and messages and bytes sent on each link.
Topic ``/truth/late`` has the intervals in which the kernel delayed sent bytes: log time begin, publish time end.
Attachments and metadata: the scenario (``scenario.json``), whether the flight was in real time (metadata ``flight``),
the configuration with the files that it names, as in a session, and the rate of each kind of measurement of each device
(``sent_rates.json``).  The values that each device intends to send, once a second, are on
``/truth/measurement/<device>`` at the time of the sample.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fti.config import Device
from fti.constants import SECOND_NS
from fti.hil.environment import Environment
from fti.hil.ports.counters import EndpointCounters
from fti.hil.sensors.intended_values import IntendedValues
from fti.logger.stream_writer import StreamWriter

RATE_HZ = 25.0
FLUSH_EVERY = 5
TOPIC, LATE_TOPIC, END_TOPIC = "/truth/state", "/truth/late", "/truth/end"
MEASUREMENT = "/truth/measurement/"
SCENARIO_ATTACHMENT, RATES_ATTACHMENT = "scenario.json", "sent_rates.json"
#: Metadata of the file, and its key, with the value "true" or "false".
FLIGHT_METADATA, REAL_TIME_KEY = "flight", "real_time"
#: Accuracy with which the position of an aircraft can be known [m], for ``Environment.range_bounds``.
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
    "deviation": "angle above the glide path as seen from its intercept point [rad]; absent beyond it",
}
#: Columns of each altimeter, as prefix of its name.
RANGES = {
    "range_": "of this altimeter, without noise [m]; absent without return",
    "least_range_": f"smallest range within {POSITION_TOLERANCE_M:g} m of the position, in the same attitude [m]",
    "most_range_": "largest range, likewise [m]",
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
    """Contents of the truth file of one flight.

    They are computed before the flight, because a second of computation at real-time priority would delay others.
    until_s : time of the last row [s]
    """

    def __init__(
        self,
        world: Environment,
        altimeters: Sequence[Device] = (),
        rates: Mapping[str, Mapping[str, float]] | None = None,
        intended: Sequence[IntendedValues] = (),
        until_s: float = math.inf,
    ) -> None:
        self.altimeters, self.scenario_text = altimeters, world.scenario.flight_key
        self.rates, self.intended = rates or {}, intended
        t = np.arange(0.0, world.duration, 1.0 / RATE_HZ)
        self.t = t[t <= until_s]
        self.columns = _columns(world, self.t)  # shape (n,) as t; NaN where a value is unknown
        for device in altimeters:
            bounds = world.range_bounds(self.t, device, POSITION_TOLERANCE_M)
            self.columns |= {prefix + device.name: column for prefix, column in zip(RANGES, bounds, strict=True)}

    def row(self, k: int) -> dict[str, float]:
        """The finite values of row k."""
        values = {name: float(column[k]) for name, column in self.columns.items()}
        return {name: value for name, value in values.items() if math.isfinite(value)}


class TruthLog:
    """The truth file of one flight.

    real_time : the flight runs in real time; texts : the files of the configuration by names of attachments
    """

    def __init__(
        self, path: Path, rows: TruthRows, *, real_time: bool = True, texts: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self._rows = rows
        path.parent.mkdir(parents=True, exist_ok=True)
        self._writer = StreamWriter(path)
        self._writer.add_attachment(SCENARIO_ATTACHMENT, "application/json", rows.scenario_text.encode(), log_time=0)
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
        """Write the intended values of all devices until a time of the flight."""
        intended = self._rows.intended
        while self._written < len(intended) and intended[self._written].t_s <= until_s:
            one = intended[self._written]
            t_ns = start_ns + round(one.t_s * SECOND_NS)
            content = json.dumps({"t_ns": t_ns, "values": one.values}).encode()
            self._writer.write(self._device_channels[one.device], t_ns, content, self._written, now_ns)
            self._written += 1

    def note_late(self, from_ns: int, until_ns: int) -> None:
        """Record that bytes sent at from_ns left the port at until_ns."""
        text = json.dumps({"from_ns": from_ns, "until_ns": until_ns})
        self._writer.write(self._late_channel, from_ns, text.encode(), publish_time=until_ns)

    def note_end(self, counters: Mapping[str, EndpointCounters]) -> None:
        """Record the end of the flight, complete or stopped.  counters : of each link"""
        links = {name: {"messages": one.messages, "bytes": one.bytes} for name, one in counters.items()}
        text = json.dumps({"rows": self._count, "sent": links})
        self._writer.write(self._end_channel, self._last_ns, text.encode(), publish_time=self._last_ns)

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()


class TruthStream:
    """Rows of the truth as a stream of the scheduler."""

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
        """Time of the next row."""
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
    s, y = path.to_path(now.lat, now.lon)
    dh = now.alt - path.alt_path(s)
    deviation = np.where(s > 0.0, np.arctan2(s * math.tan(path.glide) + dh, s) - path.glide, np.nan)
    north, east, down = now.vel_n.T
    values = (
        now.lat, now.lon, now.alt, now.alt - world.undulation, north, east, down, np.hypot(north, east),
        now.roll, now.pitch, now.heading, now.tas, s, y, now.alt - world.ground(now), dh, deviation,
    )  # fmt: skip
    return dict(zip(QUANTITIES, values, strict=True))

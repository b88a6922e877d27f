"""Vectors of the drivers: ``vectors/NAME.bin`` are the bytes, ``vectors/NAME.json`` the expected results.

driver, options    which driver decodes them, and how
origin             who made the bytes; outside = not this project
independent        reference of the values
messages           how many of each message there are; every byte belongs to one of them
expect             fields of the index-th measurement of a class, as the independent side states them
canonical          the emulator sends the same bytes again for what was decoded
round_trips        a field of a measurement over its whole range, and half the resolution of the wire; ``also``:
                   other fields; ``then``: measurements that make the encoder send; ``wrap``: an angle
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fti import config, drivers
from fti.drivers import Counters, Decoder, Driver
from fti.messages import measurements
from fti.messages.measurements import Measurement, Stamp
from fti.ranging.scan_points import make_scan, point_arrays

FOLDER = Path(__file__).parent / "vectors"
CAN_FRAME = 16


@dataclass(frozen=True)
class Vector:
    name: str
    data: bytes
    facts: dict[str, Any]

    @property
    def driver(self) -> Driver:
        return drivers.load(self.facts["driver"])

    @property
    def options(self) -> config.StrictModel:
        return config.bind(self.driver.Options, self.facts["options"], self.name)

    @property
    def is_can(self) -> bool:
        return "can" in self.driver.CARRIERS

    def decoder(self) -> Decoder:
        return self.driver.make_decoder(self.options)

    def reads(self) -> list[bytes]:
        """The bytes as a link hands them over: in one piece, or frame by frame."""
        return frames(self.data) if self.is_can else [self.data]


def frames(data: bytes) -> list[bytes]:
    return [data[at : at + CAN_FRAME] for at in range(0, len(data), CAN_FRAME)]


def load(name: str) -> Vector:
    facts = json.loads((FOLDER / f"{name}.json").read_text())
    return Vector(name, (FOLDER / f"{name}.bin").read_bytes(), facts)


VECTORS = [load(path.stem) for path in sorted(FOLDER.glob("*.json"))]


def vectors_of(driver: str) -> list[Vector]:
    return [v for v in VECTORS if v.facts["driver"] == driver]


def feed_all(decoder: Decoder, reads: Iterable[bytes], t_rx_ns: int = 7) -> list[Measurement]:
    """Feed, and hold the decoder to its accounts after every read."""
    results: list[Measurement] = []
    fed = 0
    for data in reads:
        results += decoder.feed(data, t_rx_ns)
        fed += len(data)
        assert_accounted(decoder.counters, fed)
    return results


def assert_accounted(counters: Counters, fed: int) -> None:
    assert counters.bytes_in == fed
    assert counters.bytes_in == counters.framed + counters.held + sum(counters.skipped.values())
    assert min(counters.framed, counters.held, *counters.skipped.values(), 0) == 0


def make(facts: dict[str, Any], stamp: Stamp) -> Measurement:
    """A measurement of plain facts: its class by name, its fields; all points of a scan have its median."""
    if facts["measurement"] == "RangeScan":
        count = facts["points"]
        return make_scan(stamp, [facts["median"]] * count, point_arrays([(0.0, 0.0, 1.0)] * count, [0.0] * count))
    fields = {k: tuple(v) if isinstance(v, list) else v for k, v in facts.items() if k != "measurement"}
    measurement: Measurement = getattr(measurements, facts["measurement"])(stamp=stamp, **fields)
    return measurement


def assert_matches(found: object, expected: dict[str, Any], tolerance: float, where: str) -> None:
    """Every field that is expected is there."""
    for name, value in expected.items():
        measurements = getattr(found, name)
        if isinstance(value, dict):
            assert_matches(measurements, value, tolerance, f"{where}.{name}")
        elif isinstance(value, list):
            assert len(measurements) == len(value), f"{where}.{name}"
            assert all(is_close(s, v, tolerance) for s, v in zip(measurements, value, strict=True)), (
                f"{where}.{name}: {measurements}"
            )
        else:
            assert is_close(measurements, value, tolerance), f"{where}.{name}: {measurements!r}, expected {value!r}"


def is_close(measurements: Any, value: Any, tolerance: float) -> bool:
    if isinstance(value, float) and isinstance(measurements, float):
        return math.isclose(measurements, value, rel_tol=0.0, abs_tol=tolerance)
    return bool(measurements == value)


def of_class(results: Iterable[Measurement], name: str) -> Iterator[Measurement]:
    return (m for m in results if type(m).__name__ == name)

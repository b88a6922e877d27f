"""Which message counts where several carry the same quantity, and what becomes of the others.

A measurement does not say which message it comes from, so a consumer must never get two kinds of it from one device:
the position of the system and that of its receiver's antenna, raw inertial data and corrected ones.  What gives way
becomes Readings with the names of message and field: nothing is lost, and nothing is mixed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from fti.types import ImuSample, Measurement, Position, PressureAltitude, Reading, Velocity

#: The messages that carry a quantity, best first; those in one line come from the same filter and say the same.
PREFERRED: dict[type, tuple[tuple[str, ...], ...]] = {
    ImuSample: (("IMUCORR",), ("INSSOL",), ("IMURAW",)),
    Velocity: (("INSSOL", "INSVELNED", "INSVELENU", "INSGNDSPEED"), ("GNSSSOL",)),
    Position: (("INSSOL", "INSPOSLLH"), ("GNSSSOL",)),
    PressureAltitude: (("AIRDATA",), ("INSSOL",)),
}
RANKS = {(kind, name): rank for kind, lines in PREFERRED.items() for rank, names in enumerate(lines) for name in names}
#: For so long after a better message the others give way [ns].
PATIENCE_NS = 5_000_000_000

UNITS = {
    "rad": ("lat", "lon", "track"),
    "m": ("alt", "alt_msl", "undulation", "horizontal_sd", "vertical_sd", "alt_press"),
    "m/s": ("north", "east", "down", "ground_speed", "sd"),
    "m/s^2": ("accel_b",),
    "rad/s": ("gyro_b",),
}
UNIT_OF = {name: unit for unit, names in UNITS.items() for name in names}


class Belief:
    """Remembers which message last carried each quantity."""

    def __init__(self) -> None:
        self._best: dict[type, tuple[int, int]] = {}

    def sift(self, name: str, found: list[Measurement]) -> list[Measurement]:
        """The measurements of a message; those that give way as Readings."""
        out: list[Measurement] = []
        for m in found:
            rank = RANKS.get((type(m), name))
            if rank is None or self._counts(type(m), rank, m.stamp.t_rx_ns):
                out.append(m)
            else:
                out += as_readings(name.lower(), m)
        return out

    def _counts(self, kind: type, rank: int, now: int) -> bool:
        best, since = self._best.get(kind, (rank, now))
        if rank > best and 0 <= now - since <= PATIENCE_NS:
            return False
        self._best[kind] = rank, now
        return True


def as_readings(prefix: str, measurement: Measurement) -> Iterator[Reading]:
    """Every number of a measurement, as ``prefix_field``; of a vector, as ``prefix_field_x`` and so on."""
    valid = getattr(measurement, "valid", True)
    for field in fields(measurement):
        if (unit := UNIT_OF.get(field.name)) is None:
            continue
        value = getattr(measurement, field.name)
        parts = zip(("_x", "_y", "_z"), value, strict=True) if isinstance(value, tuple) else [("", value)]
        for axis, number in parts:
            if number is not None:
                name = f"{prefix}_{field.name}{axis}"
                yield Reading(stamp=measurement.stamp, name=name, value=number, unit=unit, valid=valid)

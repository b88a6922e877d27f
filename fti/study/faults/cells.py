"""The table of cells: fault, magnitude, grade, receivers, and legs or turns.

Source: known faults of receivers, barometers and inertial units.  Ramps of position from 0.1 to 3 m/s,
with and without the velocity that belongs to them, sharp or growing with 0.02, 0.1 or 0.3 m/s^2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product

GRADES = ("navigation", "tactical", "industrial", "mems")
PATTERNS = ("legs", "turns")
SHARP = math.inf
ONSETS_M_S2 = (SHARP, 0.02, 0.1, 0.3)


class SensorFault(StrEnum):
    """Kind of fault; receivers first, then barometer and inertial unit."""

    NONE = "none"
    FROZEN = "frozen"  # position and velocity repeat with fresh time
    FROZEN_POSITION = "frozen-position"  # the velocity still changes
    JUMP = "jump"  # of the position, horizontal, at once
    SWAPPED = "swapped"  # latitude and longitude
    RAMP = "ramp"  # of the position, horizontal
    SIGMA = "sigma"  # the stated sigma is too small by this factor: errors of 10 s are added
    UNDULATION_ZERO = "undulation-zero"  # undulation 0, ellipsoidal height equal to that above mean sea level
    MSL_HEIGHT = "msl-height"  # height above mean sea level for that above the ellipsoid
    HEIGHT = "height"  # constant error
    TIME_STEP = "time-step"  # values of a moment earlier
    BARO_STEP = "baro-step"
    BARO_RAMP = "baro-ramp"
    QNH = "qnh"  # wrong pressure setting
    ACCEL_STEP = "accel-step"  # bias of one axis
    GYRO_STEP = "gyro-step"
    ACCEL_STUCK = "accel-stuck"  # one axis repeats
    GYRO_STUCK = "gyro-stuck"
    ACCEL_SATURATED = "accel-saturated"  # limit of all axes
    GYRO_SATURATED = "gyro-saturated"


BARO_KINDS = frozenset({SensorFault.BARO_STEP, SensorFault.BARO_RAMP, SensorFault.QNH})
INERTIAL_KINDS = frozenset(kind for kind in SensorFault if kind.startswith(("accel-", "gyro-")))
UNITS = {
    SensorFault.JUMP: "m", SensorFault.RAMP: "m/s", SensorFault.SIGMA: "times", SensorFault.HEIGHT: "m",
    SensorFault.TIME_STEP: "s", SensorFault.BARO_STEP: "m", SensorFault.BARO_RAMP: "m/s", SensorFault.QNH: "hPa",
    SensorFault.ACCEL_STEP: "m/s^2", SensorFault.GYRO_STEP: "deg/s",
    SensorFault.ACCEL_SATURATED: "m/s^2", SensorFault.GYRO_SATURATED: "deg/s",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell.  ``magnitude`` in ``unit``; the other fields of a fault count for ramps alone.

    onset_m_s2 : acceleration with which a ramp grows, infinite when sharp;  with_velocity : the velocity follows it
    receivers  : in the aircraft;  faulty_receivers : how many of them have the fault, all alike
    pattern    : legs or turns while the fault lasts
    """

    grade: str
    kind: SensorFault
    magnitude: float = 0.0
    onset_m_s2: float = SHARP
    with_velocity: bool = False
    receivers: int = 1
    faulty_receivers: int = 1
    pattern: str = "legs"

    @property
    def unit(self) -> str:
        """Unit of the magnitude; empty without one."""
        return UNITS.get(self.kind, "")

    @property
    def name(self) -> str:
        """Stable and unique, such as ``tactical/ramp-velocity-1-onset-0.1/1-of-1/legs``."""
        kind = self.kind + ("-velocity" if self.with_velocity else "")
        size = f"-{self.magnitude:g}" if self.unit else ""
        onset = "" if math.isinf(self.onset_m_s2) else f"-onset-{self.onset_m_s2:g}"
        return f"{self.grade}/{kind}{size}{onset}/{self.faulty_receivers}-of-{self.receivers}/{self.pattern}"


#: Faults other than ramps: kind and magnitudes.
SIZES: tuple[tuple[SensorFault, tuple[float, ...]], ...] = (
    (SensorFault.FROZEN, (0.0,)),
    (SensorFault.FROZEN_POSITION, (0.0,)),
    (SensorFault.JUMP, (30.0, 100.0, 1000.0)),
    (SensorFault.SWAPPED, (0.0,)),
    (SensorFault.SIGMA, (3.0, 10.0)),
    (SensorFault.UNDULATION_ZERO, (0.0,)),
    (SensorFault.MSL_HEIGHT, (0.0,)),
    (SensorFault.HEIGHT, (47.0, 83.0)),
    (SensorFault.TIME_STEP, (0.2, 1.0, 5.0)),
    (SensorFault.BARO_STEP, (30.0, 100.0)),
    (SensorFault.BARO_RAMP, (0.1, 1.0)),
    (SensorFault.QNH, (5.0, 10.0)),
    (SensorFault.ACCEL_STEP, (0.05, 0.5)),
    (SensorFault.GYRO_STEP, (0.01, 0.1, 1.0)),
    (SensorFault.ACCEL_STUCK, (0.0,)),
    (SensorFault.GYRO_STUCK, (0.0,)),
    (SensorFault.ACCEL_SATURATED, (10.0,)),
    (SensorFault.GYRO_SATURATED, (3.0,)),
)
RATES_M_S = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0)
#: Faults with two receivers; each kind is one of a receiver.
PAIR_SIZES: tuple[tuple[SensorFault, tuple[float, ...]], ...] = (
    (SensorFault.FROZEN, (0.0,)),
    (SensorFault.JUMP, (100.0,)),
    (SensorFault.HEIGHT, (47.0,)),
)
PAIR_RAMPS = tuple(product((0.3, 1.0, 3.0), (SHARP, 0.1)))


def _single(grade: str) -> Iterator[Cell]:
    yield Cell(grade, SensorFault.NONE)
    for kind, sizes in SIZES:
        for size in sizes:
            yield Cell(grade, kind, size)
    for rate in RATES_M_S:
        yield Cell(grade, SensorFault.RAMP, rate)
        for onset in ONSETS_M_S2:
            yield Cell(grade, SensorFault.RAMP, rate, onset, with_velocity=True)


def _pairs(grade: str) -> Iterator[Cell]:
    yield Cell(grade, SensorFault.NONE, receivers=2)
    for faulty_receivers in (1, 2):
        for kind, sizes in PAIR_SIZES:
            for size in sizes:
                yield Cell(grade, kind, size, receivers=2, faulty_receivers=faulty_receivers)
        for rate, onset in PAIR_RAMPS:
            yield Cell(
                grade, SensorFault.RAMP, rate, onset, with_velocity=True, receivers=2, faulty_receivers=faulty_receivers
            )


CELLS: tuple[Cell, ...] = tuple(
    replace(cell, pattern=pattern)
    for grade in GRADES
    for make in (_single, _pairs)
    for cell in make(grade)
    for pattern in PATTERNS
)

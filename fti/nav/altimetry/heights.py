"""One altimeter's channel: from its samples, or its silence, to HeightAboveGround."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fti.config import Altimeter, Device, Vector
from fti.nav.altimetry.compensation import height_at_p, lower, mounting_of
from fti.nav.altimetry.validity import Sample, compares, reasons_against
from fti.nav.ground import Ground
from fti.nav.navigation import NavState
from fti.types import HeightAboveGround, RadioHeight, Range, Reason

if TYPE_CHECKING:
    from fti.nav.altimetry.expected import Expectation, Expected

#: How often an altimeter that says nothing is reported [ns].
REPEAT_NS = 500_000_000
#: What the known ground says against a sample, and nothing else does.
BY_GROUND = frozenset({Reason.DEVIATION, Reason.NOT_NADIR, Reason.DISPERSION, Reason.INCIDENCE})


@dataclass(frozen=True, slots=True)
class Reading:
    """A sample as the device gave it, at the time at which it was true."""

    t_ns: int
    t_valid_ns: int
    value: float | None
    sd: float | None
    flagged: bool


def stands_alone(height: HeightAboveGround) -> bool:
    """Whether nothing but the known ground speaks against it: what is new on the ground is seen by such heights."""
    return BY_GROUND.issuperset(height.reasons)


class AltimeterChannel:
    """Validity, compensation and age of one altimeter.

    unchecked : why there is no known ground to compare with, until there is one
    wheels_b  : P to the lowest wheel, body frame [m], where that is known
    """

    def __init__(self, device: Device, unchecked: Reason = Reason.NO_TERRAIN, wheels_b: Vector | None = None) -> None:
        if device.altimeter is None:
            raise ValueError(f"device {device.name!r} has no [device.altimeter] table")
        self._device = device
        self._unchecked = unchecked
        self._expectation: Expectation | None = None
        self.name = device.name
        self.limits = device.altimeter
        self._mounting = mounting_of(device)
        self._wheels_b = wheels_b
        self._max_age_ns = round(device.max_age_ms * 1e6)
        self._started_ns: int | None = None
        self._last: Reading | None = None
        self._told_ns: int | None = None

    def give_ground(self, ground: Ground | None) -> None:
        """From now on samples are compared with this ground; None: with none."""
        from fti.nav.altimetry.expected import Expectation  # noqa: PLC0415 - numba: not needed without a ground

        self._expectation = Expectation(self._device, ground) if ground else None
        self._unchecked = Reason.NO_TERRAIN

    def read(self, m: RadioHeight | Range, t_valid_ns: int) -> Reading:
        """What a measurement says; sigma from the configuration when the device states none."""
        value = _number(m.height_agl if isinstance(m, RadioHeight) else m.slant_range)
        sd = _number(m.sd)
        return Reading(m.stamp.t_rx_ns, t_valid_ns, value, self.limits.sd_m if sd is None else sd, not m.valid)

    def take(self, reading: Reading, nav: NavState) -> HeightAboveGround:
        """The output of a sample, with the attitude at its time."""
        if self._last is None or reading.t_valid_ns >= self._last.t_valid_ns:
            self._last = reading
        self._told_ns = None
        return self._output(reading.t_ns, reading, nav, reading.t_ns - reading.t_valid_ns)

    def tick(self, t_ns: int, nav: NavState) -> list[HeightAboveGround]:
        """Nothing while samples come; when they stop, an invalid output at once and then twice a second."""
        self._started_ns = t_ns if self._started_ns is None else self._started_ns
        since = self._last.t_valid_ns if self._last else self._started_ns
        if t_ns - since <= self._max_age_ns:
            return []
        if self._told_ns is not None and t_ns - self._told_ns < REPEAT_NS:
            return []
        self._told_ns = t_ns
        return [self._output(t_ns, self._last, nav, t_ns - since)]

    @property
    def heard(self) -> bool:
        """Whether a sample ever came."""
        return self._last is not None

    def is_stale(self, t_ns: int) -> bool:
        """Whether the newest sample is older than max_age_ms."""
        return self._last is not None and t_ns - self._last.t_valid_ns > self._max_age_ns

    def _output(self, t_ns: int, reading: Reading | None, nav: NavState, age_ns: int) -> HeightAboveGround:
        attitude = nav.attitude
        height, sd = self._compensated(reading, nav)
        expected = self._expected(reading, nav)
        sample = Sample(
            value=reading.value if reading else None,
            flagged=reading is not None and reading.flagged,
            heard=reading is not None,
            age_ns=age_ns,
            max_age_ns=self._max_age_ns,
            roll=attitude.roll if attitude else None,
            pitch=attitude.pitch if attitude else None,
            height=height,
            **_by_ground(expected),
        )
        reasons = reasons_against(sample, self.limits)
        return HeightAboveGround(
            t_ns=t_ns,
            t_valid_ns=reading.t_valid_ns if reading else None,
            sensor=self.name,
            raw=sample.value,
            height_agl=height,
            sd=sd,
            valid=not reasons,
            reasons=reasons,
            wheels=self._of_wheels(height, nav),
            **_told(expected, sample.value, self.limits),
        )

    def _expected(self, reading: Reading | None, nav: NavState) -> Expected | Reason | None:
        """What the sample should be, or why nobody knows; None where there is no sample."""
        if self._expectation is None:
            return self._unchecked
        return self._expectation.at(nav, reading.sd) if reading else None

    def _of_wheels(self, height: float | None, nav: NavState) -> float | None:
        """Height of the wheels [m], of one of P."""
        if height is None or nav.attitude is None or self._wheels_b is None:
            return None
        return height - lower(self._wheels_b, nav.attitude.roll, nav.attitude.pitch)

    def _compensated(self, reading: Reading | None, nav: NavState) -> tuple[float | None, float | None]:
        attitude = nav.attitude
        if reading is None or reading.value is None or reading.value < 0.0 or attitude is None:
            return None, None
        height = height_at_p(
            reading.value,
            attitude.roll,
            attitude.pitch,
            self._mounting,
            range_sd=reading.sd,
            roll_sd=attitude.roll_sd,
            pitch_sd=attitude.pitch_sd,
        )
        return height.height_agl, height.sd


def _by_ground(expected: Expected | Reason | None) -> dict[str, Any]:
    """What the ground says about a sample before it is judged; None where it cannot tell, as over a hole."""
    if expected is None or isinstance(expected, Reason):
        return {}
    return {
        "predicted": _number(expected.slant_range),
        "dispersion": _number(expected.dispersion),
        "incidence": _number(expected.incidence),
        "navigated": _number(expected.height),
        "predicted_sd": expected.range_sd,
        "ground_sd": expected.ground_sd,
    }


def _told(expected: Expected | Reason | None, value: float | None, limits: Altimeter) -> dict[str, Any]:
    """What the ground adds to an output."""
    if expected is None:
        return {}
    if isinstance(expected, Reason):
        return {"unchecked": (expected,)}
    found: dict[str, Any] = {"predicted": expected.slant_range, "predicted_sd": expected.range_sd}
    if value is None:
        return found
    if not compares(expected.range_sd, limits):
        found["unchecked"] = (Reason.UNCERTAIN,)
    if (by_ground := expected.compensated(value)) is None:  # the beam meets known ground, and straight below is none
        return {**found, "unchecked": (*found.get("unchecked", ()), Reason.TERRAIN_HOLE)}
    names = ("compensated", "compensated_sd", "compensation")
    return {**found, **dict(zip(names, by_ground, strict=True))}


def _number(value: float | None) -> float | None:
    """The value; None where it is no number, for nan passes every limit."""
    return value if value is not None and math.isfinite(value) else None

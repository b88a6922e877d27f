"""One altimeter's channel: from its samples, or its silence, to HeightAboveGround."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from fti.config import Device, Vector
from fti.nav.altimetry.change import ChangeCheck
from fti.nav.altimetry.compensation import (
    CompensatedHeight,
    height_at_p,
    lever_arm_drop,
    mounting_of,
    nonlinear_tilt_sd,
    tilt_of,
)
from fti.nav.altimetry.deviation import BEGIN_COUNT, DeviationMemory
from fti.nav.altimetry.expected_sample import ExpectedSample, ExpectedSampleOrReason, NoGround
from fti.nav.altimetry.observation import make_observation
from fti.nav.altimetry.relief import ReliefEstimator
from fti.nav.altimetry.sigmas import RANGE_SD_UNKNOWN, stated_sd
from fti.nav.altimetry.validity import Sample, is_conclusive, is_within_limit, reasons_against
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import ATTITUDE_SD_UNKNOWN
from fti.nav.terrain_reference import Ground
from fti.types import Compensation, HeightAboveGround, RadioHeight, Range, Reason

if TYPE_CHECKING:
    from fti.nav.altimetry.expected_range import AltimeterPredictor

#: How often an altimeter that says nothing is reported [ns].
REPEAT_NS = 500_000_000
#: What lies beside the point straight below is looked for so far off the vertical at most [rad].
MAX_OFF_NADIR = math.radians(60.0)
#: No altimeter has a longer range [m]: a value beyond is no number, and its square has to be one.
MAX_RANGE_M = 1e6
#: The profile along the track does not tell how steep the ground is across it.
ACROSS_TRACK_FACTOR = 1.25
#: What the known ground says against a sample, and nothing else does.
TERRAIN_REASONS = frozenset(
    {Reason.DEVIATION, Reason.NOT_NADIR, Reason.DISPERSION, Reason.INCIDENCE, Reason.CHANGE_MISMATCH}
)
#: The integrity monitor judges these heights: it finds what is new on the ground, and says itself what is stuck or has
#: a bias.
MONITORED_REASONS = TERRAIN_REASONS | {Reason.STUCK, Reason.ALTIMETERS_DISAGREE, Reason.EXCLUDED}
#: Samples with one of these are no ranges to the ground, or of an aircraft whose attitude nobody knows.
NO_RANGE_REASONS = frozenset(
    {Reason.DEVICE_FLAG, Reason.NO_RETURN, Reason.BELOW_RANGE, Reason.ABOVE_RANGE, Reason.NO_ATTITUDE}
)


#: With one of these a deviation from the prediction does not prove that the altimeter is wrong.
INCONCLUSIVE_REASONS = frozenset({Reason.ROLL, Reason.PITCH, Reason.DISPERSION, Reason.INCIDENCE})


@dataclass(frozen=True, slots=True)
class AltimeterReading:
    """A sample as the device gave it, at the time at which it was true."""

    t_ns: int
    t_valid_ns: int
    value: float | None
    sd: float | None
    flagged: bool


@dataclass(frozen=True, slots=True)
class NadirHeight:
    """Height of P above the ground straight below it, its one sigma [m], and how it was made."""

    height_agl: float
    sd: float
    compensation: Compensation


def is_monitorable(height: HeightAboveGround) -> bool:
    """Whether the integrity monitor judges it: nothing but the known ground, the tests with a memory and the
    filter refuse it.
    """
    return MONITORED_REASONS.issuperset(height.reasons)


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
        self._predictor: AltimeterPredictor | None = None
        self.name = device.name
        self.limits = device.altimeter
        self._mounting = mounting_of(device)
        self._wheels_b = wheels_b
        self._max_age_ns = round(device.max_age_ms * 1e6)
        self._started_ns: int | None = None
        self._relief = ReliefEstimator(device.altimeter.relief_m)
        self._last: AltimeterReading | None = None
        self._reported_ns: int | None = None
        self._change = ChangeCheck()
        self._deviation = DeviationMemory()
        self._is_ground_contradicted = False

    def set_terrain(self, ground: Ground | None) -> None:
        """From now on samples are compared with this ground; None: with none."""
        from fti.nav.altimetry.expected_range import AltimeterPredictor  # noqa: PLC0415 - numba: not needed without a ground

        self._predictor = AltimeterPredictor(self._device, ground) if ground else None
        self._unchecked = Reason.NO_TERRAIN

    def set_ground_contradicted(self, is_contradicted: bool) -> None:
        """Altitude or terrain is wrong (``ground_check``): from now on samples are not compared; or they are again."""
        if is_contradicted and not self._is_ground_contradicted:
            self._deviation.forget()
            self._change.reset_terrain_tests()
        self._is_ground_contradicted = is_contradicted

    def read(self, m: RadioHeight | Range, t_valid_ns: int) -> AltimeterReading:
        """What a measurement says; sigma from the configuration when the device states none."""
        value = _number(m.height_agl if isinstance(m, RadioHeight) else m.slant_range)
        value = None if value is not None and abs(value) > MAX_RANGE_M else value
        sd = _number(m.sd)
        return AltimeterReading(m.stamp.t_rx_ns, t_valid_ns, value, self.limits.sd_m if sd is None else sd, not m.valid)

    def take(self, reading: AltimeterReading, nav: NavState) -> HeightAboveGround:
        """The output of a sample, with the attitude at its time."""
        if self._last is None or reading.t_valid_ns >= self._last.t_valid_ns:
            self._last = reading
        self._reported_ns = None
        output = self._output(reading.t_ns, reading, nav, reading.t_ns - reading.t_valid_ns, is_sample=True)
        if is_monitorable(output) and output.nearest is not None and reading.value is not None:
            self._relief.take(reading.t_valid_ns, reading.value, output.nearest, nav)
        return output

    def widen(self, height: HeightAboveGround) -> HeightAboveGround:
        """A height of this altimeter with what its memory adds to the sigmas (``ChangeCheck.unexplained_sd``).

        Other altimeters are compared with the sigmas of before: an altimeter that errs may not differ by more for that.
        """
        added = self._change.unexplained_sd
        if added == 0.0 or height.sd is None or height.nearest_sd is None:
            return height
        return replace(height, sd=math.hypot(height.sd, added), nearest_sd=math.hypot(height.nearest_sd, added))

    def tick(self, t_ns: int, nav: NavState) -> list[HeightAboveGround]:
        """Nothing while samples come; when they stop, an invalid output at once and then twice a second."""
        self._started_ns = t_ns if self._started_ns is None else self._started_ns
        since = self._last.t_valid_ns if self._last else self._started_ns
        if t_ns - since <= self._max_age_ns:
            return []
        if self._reported_ns is not None and t_ns - self._reported_ns < REPEAT_NS:
            return []
        self._reported_ns = t_ns
        return [self._output(t_ns, self._last, nav, t_ns - since)]

    @property
    def since_ns(self) -> Mapping[Reason, int]:
        """When the cause of each refusal began that is in force by the memory of this altimeter [ns]."""
        since = dict(self._change.since_ns)
        if self._deviation.since_ns is not None:
            since[Reason.DEVIATION] = self._deviation.since_ns
        return since

    @property
    def has_samples(self) -> bool:
        """Whether a sample ever came."""
        return self._last is not None

    def is_stale(self, t_ns: int) -> bool:
        """Whether the newest sample is older than max_age_ms."""
        return self._last is not None and t_ns - self._last.t_valid_ns > self._max_age_ns

    def _output(
        self, t_ns: int, reading: AltimeterReading | None, nav: NavState, age_ns: int, *, is_sample: bool = False
    ) -> HeightAboveGround:
        attitude = nav.attitude
        nearest = self._nearest(reading, nav)
        expected = told = self._expected_sample(reading, nav)
        if self._is_ground_contradicted and isinstance(told, ExpectedSample | NoGround):
            expected = Reason.GROUND_CONTRADICTED
        below = self._nadir_height(reading, nearest, expected, nav)
        sample = Sample(
            value=reading.value if reading else None,
            flagged=reading is not None and reading.flagged,
            has_samples=reading is not None,
            age_ns=age_ns,
            max_age_ns=self._max_age_ns,
            roll=attitude.roll if attitude else None,
            pitch=attitude.pitch if attitude else None,
            height=nearest.height_agl if nearest else None,
            **_terrain_fields(expected),
        )
        reasons = reasons_against(sample, self.limits)
        if is_sample and reading is not None:
            reasons += self._reasons_by_memory(reading, nav, expected, reasons)
        return HeightAboveGround(
            t_ns=t_ns,
            t_valid_ns=reading.t_valid_ns if reading else None,
            sensor=self.name,
            raw=sample.value,
            height_agl=below.height_agl if below else None,
            sd=below.sd if below else None,
            compensation=below.compensation if below else None,
            nearest=nearest.height_agl if nearest else None,
            nearest_sd=nearest.sd if nearest else None,
            valid=not reasons,
            reasons=reasons,
            wheels=self._wheel_height(below, nav),
            **self._prediction(told, sample.value, nav),
        )

    def _reasons_by_memory(
        self,
        reading: AltimeterReading,
        nav: NavState,
        expected: ExpectedSampleOrReason | None,
        against: tuple[Reason, ...],
    ) -> tuple[Reason, ...]:
        """What the memory of this altimeter says against a sample; one that is no range does not change it."""
        if reading.value is None or not NO_RANGE_REASONS.isdisjoint(against):
            return self._change.reasons
        known = expected if isinstance(expected, ExpectedSample) else None
        seen = make_observation(reading.t_valid_ns, reading.value, reading.sd, nav, expected=known)
        by_change = self._change.update(seen, deviates=Reason.DEVIATION in against)
        deviates = self._deviates(reading.value, expected, against)
        in_force = self._deviation.update(reading.t_valid_ns, deviates)
        has_agreed = self._deviation.agreements >= BEGIN_COUNT and self._is_compared(expected)
        stays = in_force and not has_agreed
        return (Reason.DEVIATION, *by_change) if stays and Reason.DEVIATION not in against else by_change

    def _is_compared(self, expected: ExpectedSampleOrReason | None) -> bool:
        """Whether a sample within its gate agrees; in one as wide as twice its limit it may err by more than that."""
        return isinstance(expected, ExpectedSample | NoGround) and is_conclusive(expected.range_sd, self.limits)

    def _deviates(
        self, value: float, expected: ExpectedSampleOrReason | None, against: tuple[Reason, ...]
    ) -> bool | None:
        """Whether the ground proves a sample wrong; None where it proves nothing."""
        if not INCONCLUSIVE_REASONS.isdisjoint(against):
            return None
        if Reason.DEVIATION in against:
            return True
        if not isinstance(expected, ExpectedSample | NoGround):
            return None
        is_confirmed = isinstance(expected, ExpectedSample) and is_within_limit(
            value - expected.slant_range, self.limits
        )
        return False if is_confirmed or self._is_compared(expected) else None

    def _prediction(
        self, expected: ExpectedSampleOrReason | None, value: float | None, nav: NavState
    ) -> dict[str, Any]:
        """What the ground adds to an output: the predicted range, and why that does not check the height."""
        if expected is None:
            return {}
        if not isinstance(expected, ExpectedSample):
            missing = expected if isinstance(expected, Reason) else Reason.NO_PREDICTION
            doubt = (Reason.GROUND_CONTRADICTED,) if self._is_ground_contradicted else ()
            return {"unchecked": (*doubt, missing)}
        unchecked = (
            (Reason.GROUND_CONTRADICTED, self._is_ground_contradicted),
            (Reason.NOT_INDEPENDENT, self.name in nav.altitude_holders),
            (Reason.UNCERTAIN, value is not None and not is_conclusive(expected.range_sd, self.limits)),
            # the beam meets known ground, and straight below is none
            (Reason.TERRAIN_HOLE, value is not None and expected.compensate(value) is None),
        )
        return {
            "predicted": expected.slant_range,
            "predicted_sd": expected.range_sd,
            "unchecked": tuple(reason for reason, holds in unchecked if holds),
        }

    def _expected_sample(self, reading: AltimeterReading | None, nav: NavState) -> ExpectedSampleOrReason | None:
        """What the sample should be, or why nobody knows; None where there is no sample."""
        if self._predictor is None:
            return self._unchecked
        return self._predictor.at(nav, reading.sd) if reading else None

    def _wheel_height(self, below: NadirHeight | None, nav: NavState) -> float | None:
        """Height of the wheels [m], of one of P."""
        if below is None or nav.attitude is None or self._wheels_b is None:
            return None
        return below.height_agl - lever_arm_drop(self._wheels_b, nav.attitude.roll, nav.attitude.pitch)

    def _nearest(self, reading: AltimeterReading | None, nav: NavState) -> CompensatedHeight | None:
        """Height of P above what the beam sees; None where there is no range or no attitude."""
        attitude = nav.attitude
        if reading is None or reading.value is None or reading.value < 0.0 or attitude is None:
            return None
        roll_sd, pitch_sd = (stated_sd(sd, ATTITUDE_SD_UNKNOWN) for sd in (attitude.roll_sd, attitude.pitch_sd))
        tilt = tilt_of(self._mounting, attitude.roll, attitude.pitch)
        beyond = nonlinear_tilt_sd(reading.value, tilt, self._mounting.half_beam, max(roll_sd, pitch_sd))
        range_sd = math.hypot(stated_sd(reading.sd, RANGE_SD_UNKNOWN), beyond)
        return height_at_p(
            reading.value,
            attitude.roll,
            attitude.pitch,
            self._mounting,
            range_sd=range_sd,
            roll_sd=roll_sd,
            pitch_sd=pitch_sd,
        )

    def _nadir_height(
        self,
        reading: AltimeterReading | None,
        nearest: CompensatedHeight | None,
        expected: ExpectedSampleOrReason | None,
        nav: NavState,
    ) -> NadirHeight | None:
        """Height of P above the ground straight below: by the terrain, else above what the beam sees."""
        if reading is None or reading.value is None or nearest is None or nav.attitude is None:
            return None
        known = expected.compensate(reading.value) if isinstance(expected, ExpectedSample) else None
        if known is not None:
            return NadirHeight(*known)
        tilt = tilt_of(self._mounting, nav.attitude.roll, nav.attitude.pitch)
        beside = min(max(tilt, 0.5 * self._mounting.half_beam), MAX_OFF_NADIR)
        relief = ACROSS_TRACK_FACTOR * self._relief.sd(nearest.height_agl * math.tan(beside))
        sd = RANGE_SD_UNKNOWN if nearest.sd is None else nearest.sd
        height = nearest.height_agl + self.limits.corrected_range_m(reading.value) - reading.value
        return NadirHeight(height, math.hypot(sd, relief), Compensation.ATTITUDE)


def _terrain_fields(expected: ExpectedSampleOrReason | None) -> dict[str, Any]:
    """What the ground says about a sample before it is judged; None where it cannot tell, as over a hole."""
    if isinstance(expected, NoGround):
        return {"min_range": expected.min_range, "predicted_sd": expected.range_sd}
    if not isinstance(expected, ExpectedSample):
        return {}
    return {
        "predicted": expected.slant_range,
        "dispersion": _number(expected.dispersion),
        "incidence": _number(expected.incidence),
        "navigated": _number(expected.height),
        "predicted_sd": expected.range_sd,
        "ground_sd": expected.ground_sd,
    }


def _number(value: float | None) -> float | None:
    """The value; None where it is no number: the device found no return, or the terrain has a hole there."""
    return value if value is not None and math.isfinite(value) else None

"""Processes the samples of one altimeter, or their absence, to HeightAboveGround."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from msgspec import Struct
from msgspec.structs import replace

from fti.config import Device, Vector
from fti.messages.measurements import RadioHeight, Range
from fti.messages.outputs import Compensation, HeightAboveGround
from fti.messages.reasons import Reason
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

if TYPE_CHECKING:
    from fti.nav.altimetry.expected_range import AltimeterPredictor

#: Period of reports of a silent altimeter [ns].
REPEAT_NS = 500_000_000
#: Maximum angle off the vertical for the relief around the nadir [rad].
MAX_OFF_NADIR = math.radians(60.0)
#: No altimeter has a longer range [m]: a larger value is discarded, so that its square stays finite.
MAX_RANGE_M = 1e6
#: Factor on the relief along the track, because the slope across it is unknown.
ACROSS_TRACK_FACTOR = 1.25
#: Reasons that come from the known ground alone.
TERRAIN_REASONS = frozenset(
    {Reason.DEVIATION, Reason.NOT_NADIR, Reason.DISPERSION, Reason.INCIDENCE, Reason.CHANGE_MISMATCH}
)
#: The integrity monitor uses heights with these reasons: it detects changes of the ground, and stuck or biased
#: altimeters itself.
MONITORED_REASONS = TERRAIN_REASONS | {Reason.STUCK, Reason.ALTIMETERS_DISAGREE, Reason.EXCLUDED}
#: Samples with one of these are not ranges to the ground, or the attitude is unknown.
NO_RANGE_REASONS = frozenset(
    {Reason.DEVICE_FLAG, Reason.NO_RETURN, Reason.BELOW_RANGE, Reason.ABOVE_RANGE, Reason.NO_ATTITUDE}
)


#: With one of these a deviation from the prediction does not prove that the altimeter is wrong.
INCONCLUSIVE_REASONS = frozenset({Reason.ROLL, Reason.PITCH, Reason.DISPERSION, Reason.INCIDENCE})


class AltimeterReading(Struct, frozen=True, gc=False):
    """A sample as the device states it, with its validity time."""

    t_ns: int
    t_valid_ns: int
    value: float | None
    sd: float | None
    flagged: bool


class NadirHeight(Struct, frozen=True, gc=False):
    """Height of P above the ground straight below it, its one sigma [m], and its compensation."""

    height_agl: float
    sd: float
    compensation: Compensation


def is_monitorable(height: HeightAboveGround) -> bool:
    """Whether the integrity monitor may use it: only known ground, tests over time or the filter refuse it."""
    return MONITORED_REASONS.issuperset(height.reasons)


class AltimeterChannel:
    """Validity, compensation and age of one altimeter.

    unchecked : reason why no known ground is available, until ``set_terrain``
    wheels_b  : P to the lowest wheel, body frame [m]; None: unknown
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
        """Compare samples with this ground from now on; None: with none."""
        from fti.nav.altimetry.expected_range import AltimeterPredictor  # noqa: PLC0415 - numba: not needed without a ground

        self._predictor = AltimeterPredictor(self._device, ground) if ground else None
        self._unchecked = Reason.NO_TERRAIN

    def set_ground_contradicted(self, is_contradicted: bool) -> None:
        """Stop comparing samples while altitude or terrain is wrong (``ground_check``); or resume."""
        if is_contradicted and not self._is_ground_contradicted:
            self._deviation.forget()
            self._change.reset_terrain_tests()
        self._is_ground_contradicted = is_contradicted

    def read(self, m: RadioHeight | Range, t_valid_ns: int) -> AltimeterReading:
        """The reading of a measurement; sigma from the configuration when the device states none."""
        value = _number(m.height_agl if isinstance(m, RadioHeight) else m.slant_range)
        value = None if value is not None and abs(value) > MAX_RANGE_M else value
        sd = _number(m.sd)
        return AltimeterReading(m.stamp.t_rx_ns, t_valid_ns, value, self.limits.sd_m if sd is None else sd, not m.valid)

    def feed(self, reading: AltimeterReading, nav: NavState) -> HeightAboveGround:
        """Add a sample with the navigation at its time; returns its output."""
        if self._last is None or reading.t_valid_ns >= self._last.t_valid_ns:
            self._last = reading
        self._reported_ns = None
        output = self._output(reading.t_ns, reading, nav, reading.t_ns - reading.t_valid_ns, is_sample=True)
        if is_monitorable(output) and output.nearest is not None and reading.value is not None:
            self._relief.feed(reading.t_valid_ns, reading.value, output.nearest, nav)
        return output

    def widen(self, height: HeightAboveGround) -> HeightAboveGround:
        """A height of this altimeter with enlarged sigmas (``ChangeCheck.unexplained_sd``).

        The comparison with other altimeters uses the original sigmas: an erroneous altimeter must not differ by more.
        """
        added = self._change.unexplained_sd
        if added == 0.0 or height.sd is None or height.nearest_sd is None:
            return height
        return replace(height, sd=math.hypot(height.sd, added), nearest_sd=math.hypot(height.nearest_sd, added))

    def tick(self, t_ns: int, nav: NavState) -> list[HeightAboveGround]:
        """Nothing while samples arrive; when they stop, an invalid output at once and then twice a second."""
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
        """When the cause of each refusal began that is in force by the tests over time [ns]."""
        since = dict(self._change.since_ns)
        if self._deviation.since_ns is not None:
            since[Reason.DEVIATION] = self._deviation.since_ns
        return since

    @property
    def has_samples(self) -> bool:
        """Whether any sample has arrived."""
        return self._last is not None

    def is_stale(self, t_ns: int) -> bool:
        """Whether the newest sample is older than max_age_ms."""
        return self._last is not None and t_ns - self._last.t_valid_ns > self._max_age_ns

    def _output(
        self, t_ns: int, reading: AltimeterReading | None, nav: NavState, age_ns: int, *, is_sample: bool = False
    ) -> HeightAboveGround:
        attitude = nav.attitude
        nearest = self._nearest(reading, nav)
        expected = prediction = self._expected_sample(reading, nav)
        if self._is_ground_contradicted and isinstance(prediction, ExpectedSample | NoGround):
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
            **self._prediction_fields(prediction, sample.value, nav),
        )

    def _reasons_by_memory(
        self,
        reading: AltimeterReading,
        nav: NavState,
        expected: ExpectedSampleOrReason | None,
        against: tuple[Reason, ...],
    ) -> tuple[Reason, ...]:
        """Reasons of the tests over time against a sample; a sample that is not a range leaves them unchanged."""
        if reading.value is None or not NO_RANGE_REASONS.isdisjoint(against):
            return self._change.reasons
        known = expected if isinstance(expected, ExpectedSample) else None
        observation = make_observation(reading.t_valid_ns, reading.value, reading.sd, nav, expected=known)
        by_change = self._change.update(observation, deviates=Reason.DEVIATION in against)
        deviates = self._deviates(reading.value, expected, against)
        in_force = self._deviation.update(reading.t_valid_ns, deviates)
        has_agreed = self._deviation.agreements >= BEGIN_COUNT and self._is_compared(expected)
        stays = in_force and not has_agreed
        return (Reason.DEVIATION, *by_change) if stays and Reason.DEVIATION not in against else by_change

    def _is_compared(self, expected: ExpectedSampleOrReason | None) -> bool:
        """Whether a sample within its gate agrees; not in a gate of twice the limit, where its error may be larger."""
        return isinstance(expected, ExpectedSample | NoGround) and is_conclusive(expected.range_sd, self.limits)

    def _deviates(
        self, value: float, expected: ExpectedSampleOrReason | None, against: tuple[Reason, ...]
    ) -> bool | None:
        """Whether the ground proves a sample wrong; None where it is inconclusive."""
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

    def _prediction_fields(
        self, expected: ExpectedSampleOrReason | None, value: float | None, nav: NavState
    ) -> dict[str, Any]:
        """Output fields from the ground: the predicted range, and why it does not check the height."""
        if expected is None:
            return {}
        if not isinstance(expected, ExpectedSample):
            missing = expected if isinstance(expected, Reason) else Reason.NO_PREDICTION
            contradicted = (Reason.GROUND_CONTRADICTED,) if self._is_ground_contradicted else ()
            return {"unchecked": (*contradicted, missing)}
        unchecked = (
            (Reason.GROUND_CONTRADICTED, self._is_ground_contradicted),
            (Reason.NOT_INDEPENDENT, self.name in nav.altitude_holders),
            (Reason.UNCERTAIN, value is not None and not is_conclusive(expected.range_sd, self.limits)),
            # the beam meets known ground, but the ground straight below is unknown
            (Reason.TERRAIN_HOLE, value is not None and expected.compensate(value) is None),
        )
        return {
            "predicted": expected.slant_range,
            "predicted_sd": expected.range_sd,
            "unchecked": tuple(reason for reason, holds in unchecked if holds),
        }

    def _expected_sample(self, reading: AltimeterReading | None, nav: NavState) -> ExpectedSampleOrReason | None:
        """The expected sample, or why it is unknown; None without a sample."""
        if self._predictor is None:
            return self._unchecked
        return self._predictor.predict(nav, reading.sd) if reading else None

    def _wheel_height(self, below: NadirHeight | None, nav: NavState) -> float | None:
        """Height of the wheels [m] from that of P."""
        if below is None or nav.attitude is None or self._wheels_b is None:
            return None
        return below.height_agl - lever_arm_drop(self._wheels_b, nav.attitude.roll, nav.attitude.pitch)

    def _nearest(self, reading: AltimeterReading | None, nav: NavState) -> CompensatedHeight | None:
        """Height of P above the measured point, over level ground; None without range or attitude."""
        attitude = nav.attitude
        if reading is None or reading.value is None or reading.value < 0.0 or attitude is None:
            return None
        roll_sd, pitch_sd = (stated_sd(sd, ATTITUDE_SD_UNKNOWN) for sd in (attitude.roll_sd, attitude.pitch_sd))
        beyond = nonlinear_tilt_sd(reading.value, attitude.roll, attitude.pitch, self._mounting, max(roll_sd, pitch_sd))
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
        """Height of P above the ground straight below: by the terrain, else over level ground."""
        if reading is None or reading.value is None or nearest is None or nav.attitude is None:
            return None
        known = expected.compensate(reading.value) if isinstance(expected, ExpectedSample) else None
        if known is not None:
            return NadirHeight(*known)
        tilt = tilt_of(self._mounting, nav.attitude.roll, nav.attitude.pitch)
        angle = min(max(tilt, 0.5 * self._mounting.half_beam), MAX_OFF_NADIR)
        relief = ACROSS_TRACK_FACTOR * self._relief.sd(nearest.height_agl * math.tan(angle))
        sd = RANGE_SD_UNKNOWN if nearest.sd is None else nearest.sd
        height = nearest.height_agl + self.limits.corrected_range_m(reading.value) - reading.value
        return NadirHeight(height, math.hypot(sd, relief), Compensation.ATTITUDE)


def _terrain_fields(expected: ExpectedSampleOrReason | None) -> dict[str, Any]:
    """Fields of ``Sample`` from the ground; None where it is unknown, as over a hole."""
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
    """The value; None where it is not finite: no return, or a hole in the terrain."""
    return value if value is not None and math.isfinite(value) else None

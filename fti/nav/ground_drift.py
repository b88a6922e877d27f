"""Live drift between two looks at the same ground: pairs of scans in succession aid the filter, without a map.

Each look is placed with the filter's history (``fti.nav.look_collection``) and compared with an earlier one
(``fti.nav.look_pairs``).  The drift is a measurement of position and attitude at both (``fti.nav.filter.look_mark``).
Of two line scanners the strip of the rear one is compared with the strip that the front one has measured before.

A wrong mounting or clock of the sensor, or a wrong range, is a drift as well.  So the satellites calibrate it first:
until ``CALIBRATION_COUNT`` pairs in succession have agreed with it for ``CALIBRATION_NS`` with satellites, a drift
corrects the errors of the sensor only (``Aiding.is_on_trial``).  ``REFUSED_COUNT`` pairs within ``REFUSED_NS`` that
contradict the filter end the calibration, with or without satellites: the sensor or the filter is wrong.  Without
satellites there is no new one.  A filter that starts again has no calibration.

A mounting about the vertical axis is a heading to all pairs: only their sum is known.  A time by which the scans are
stamped late cancels unless the roll changes.  Pairs therefore count only while the filter knows the heading by itself
to ``MAX_HEADING_SD``, and complete the calibration only when it knows the time to ``MAX_CLOCK_SD``: after a turn.
Until then a roll has a look of its own.  A mounting beyond ``MAX_YAW``, and a time beyond ``MAX_CLOCK``, is a
contradiction.  Otherwise a wrong mounting would become a wrong heading with a small sigma, and a
wrong clock a wrong velocity in the next turn.  A contradiction makes the errors of the sensor unknown again, and its
event names the error that explains the pairs (``fti.nav.look_diagnosis``).

The drift bounds no position: with it alone the filter coasts, and its sigma grows more slowly.  It is compared with the
satellites, and with the inertial unit without them, by copies of the filter (``fti.nav.separation.drift_watch``).
Configured by ``[nav.scan_drift]``.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace as with_fields
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from fti.arrays import Array
from fti.config import Device, ScanDriftTable
from fti.constants import SECOND_NS
from fti.messages.measurements import Measurement, RangeScan
from fti.messages.outputs import Event, GroundDrift
from fti.messages.reasons import Reason
from fti.nav.filter.look_mark import (
    CLOCK,
    CLOCK_DRIFT,
    MAX_GAP_NS,
    SCAN_DRIFT,
    SECOND_CLOCK,
    SECOND_DRIFT,
    SECOND_MOUNTING,
    SHARE,
    YAW,
    YAW_DRIFT,
    SensorReset,
)
from fti.nav.inertial_aiding import LOOKS
from fti.nav.look_collection import (
    CollectedLook,
    LookCollector,
    as_image,
    interval_ns,
    mean_rate,
    pose_times_ns,
    thin,
)
from fti.nav.look_diagnosis import LookDiagnosis, describe
from fti.nav.look_pairs import LookPairs, PairResult
from fti.nav.scan_matching.registration import Refusal, ScanDrift

if TYPE_CHECKING:
    from fti.nav.filter.estimate import Estimate
    from fti.nav.inertial_aiding import AidedNavigation

#: Pairs in succession that must agree with satellites before a drift aids, and time from the first to the last [ns].
CALIBRATION_COUNT, CALIBRATION_NS = 6, 30_000_000_000
#: Sigma of the heading that makes a mounting visible, and largest estimate of a mounting that was surveyed [rad].
MAX_HEADING_SD, MAX_YAW = 0.75 * YAW_DRIFT.sd, 2.5 * YAW_DRIFT.sd
#: Sigma of the time of the looks at which a roll does not hide its largest estimate, and that estimate [s].  The
#: latter is more than half of a frame, and less than wrong times that were flown: 50 ms were estimated as 27 and more.
MAX_CLOCK_SD, MAX_CLOCK = 0.5 * CLOCK_DRIFT.sd, 2.0 * CLOCK_DRIFT.sd
#: Errors of the sensor: sigma of a sound one, and largest estimate.
LIMITS_OF_ERRORS = {
    CLOCK: (CLOCK_DRIFT, MAX_CLOCK),
    YAW: (YAW_DRIFT, MAX_YAW),
    **dict.fromkeys(SECOND_MOUNTING, (SECOND_DRIFT, 2.5 * SECOND_DRIFT.sd)),
    SECOND_CLOCK: (CLOCK_DRIFT, MAX_CLOCK),
}
#: An error beyond its limit must be known to be one: share of the pairs in its information, and sigmas.
MIN_SHARE_OF_PAIRS, MIN_SIGMAS = 0.25, 4.0
#: Satellites were accepted within so long [ns].
SATELLITES_NS = 2_000_000_000
#: One sigma of a drift over the distance of the points, where the ground between them is not a plane.  Measured over
#: the demo region, 600 m above it: 0.009 near the airfield, with trees, 0.002 over hills.
SHARE_SD = 0.005
#: That of strips, whose lines are measured one after the other: 0.05 m straight on and 0.1 m in turns, with points that
#: are 4 m apart (scenario scan_drift_pair, 520 m above the ground, against the true poses).
STRIP_SHARE_SD = 0.02
#: Pairs that contradict the filter within so long end the calibration.
REFUSED_COUNT, REFUSED_NS = 2, 60_000_000_000
#: While the time of the scans is unknown, a roll at this rate [rad/s] has a look; time from the last look to it [ns].
MIN_ROLL_RATE, ROLL_LOOK_NS = math.radians(3.0), 1_000_000_000
#: Rate about the forward axis in the inertial sample of an estimate.
ROLL_RATE = 3
#: Greatest age of a valid drift, in intervals of its looks.
MAX_AGE_INTERVALS = 3.0
#: Repetition of the last output [ns].
REPEAT_NS = 500_000_000
REASON_OF = {
    Refusal.FEW_POINTS: Reason.FEW_POINTS,
    Refusal.FLAT: Reason.GROUND_FLAT,
    Refusal.AMBIGUOUS: Reason.AMBIGUOUS,
    Refusal.UNEXPECTED: Reason.UNEXPECTED_DRIFT,
    Refusal.MISFIT: Reason.LOOKS_MISFIT,
}
#: Fields of the output with errors of the sensor.
ERRORS_OF_FIELDS = {
    "range_share": SHARE,
    "yaw": YAW,
    "clock": CLOCK,
    **dict(zip(("second_roll", "second_pitch", "second_yaw"), SECOND_MOUNTING, strict=True)),
    "second_clock": SECOND_CLOCK,
}
NAME = "drift over the ground"


class Calibration:
    """Whether the pairs have agreed with satellites, and have not contradicted the filter since."""

    def __init__(self) -> None:
        self.is_complete = self.is_contradicting = False
        self._agreed_ns: list[int] = []  # of the pairs that have agreed in succession
        self._refused_ns: deque[int] = deque(maxlen=REFUSED_COUNT)

    def restart(self) -> None:
        """Begin again, because the filter does."""
        self.is_complete = False
        self._agreed_ns.clear()
        self._refused_ns.clear()

    def agree(self, t_ns: int, *, knows_clock: bool = True) -> bool:
        """A pair that agrees with satellites and a known heading; returns whether it completes the calibration.

        knows_clock : a roll has shown the time of the scans, without which the calibration is not complete
        """
        if self.is_complete:
            return False
        self._agreed_ns.append(t_ns)
        enough = len(self._agreed_ns) >= CALIBRATION_COUNT and t_ns - self._agreed_ns[0] >= CALIBRATION_NS
        if not (enough and knows_clock):
            return False
        self._agreed_ns.clear()
        self.is_complete, self.is_contradicting = True, False
        self._refused_ns.clear()
        return True

    def contradict(self, t_ns: int) -> bool:
        """A pair that contradicts the filter; returns whether it begins a contradiction."""
        self._agreed_ns.clear()
        self._refused_ns.append(t_ns)
        if len(self._refused_ns) < REFUSED_COUNT or t_ns - self._refused_ns[0] > REFUSED_NS:
            return False
        was_contradicting, self.is_contradicting, self.is_complete = self.is_contradicting, True, False
        return not was_contradicting

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Why a drift does not aid now."""
        table = ((Reason.CONTRADICTION, self.is_contradicting), (Reason.NOT_CALIBRATED, not self.is_complete))
        return tuple(reason for reason, holds in table if holds)


class GroundDriftAiding:
    """The drift over the ground from the scans of one device, or two.

    devices : all, by name;  aided : the filter that it aids
    """

    def __init__(self, settings: ScanDriftTable, devices: Mapping[str, Device], aided: AidedNavigation) -> None:
        self._settings, self._aided = settings, aided
        self._lever_arms_b = {name: np.array(devices[name].lever_arm_b) for name in settings.devices}
        share_sd = SHARE_SD if settings.second_device is None else STRIP_SHARE_SD
        self._looks, self._pairs = (
            LookCollector(settings, [devices[name] for name in settings.devices]),
            LookPairs(LOOKS - 1, time_sd=1e-3 * settings.time_sd_ms, share_sd=share_sd),
        )
        self._calibration, self._diagnosis = (
            Calibration(),
            LookDiagnosis(REFUSED_COUNT, has_second_scanner=settings.second_device is not None),
        )
        self._is_explained = False  # the cause of the contradiction has been reported
        self._look_ns: int | None = None  # of the last look that is in a pair
        self._counts = [0, 0]  # pairs; of them refused
        self._drift: GroundDrift | None = None
        self._sent_ns = 0
        self._events: list[Event] = []

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of a kind of a device are scans of the looks."""
        return device in self._lever_arms_b and issubclass(kind, RangeScan)

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """Take a scan whose first point was measured at t_ns."""
        if isinstance(m, RangeScan) and m.valid and device in self._lever_arms_b:
            if self._shows_clock(t_ns):
                self._looks.next_ns = t_ns
            self._looks.feed(device, m, t_ns)

    def _shows_clock(self, t_ns: int) -> bool:
        """Whether a look at t_ns, before the next one is due, is in a roll that shows the unknown time of the scans."""
        last_ns, drift = self._look_ns, self._drift
        if self._settings.second_device is not None:  # the rear scanner does not see the ground of the front one then
            return False
        if last_ns is None or self._looks.is_collecting or not last_ns + ROLL_LOOK_NS <= t_ns < self._looks.next_ns:
            return False
        if drift is None or drift.clock_sd is None or drift.clock_sd <= MAX_CLOCK_SD:
            return False
        newest_ns = self._aided.newest_ns
        estimate = None if newest_ns is None else self._aided.estimate(newest_ns)
        return estimate is not None and abs(float(estimate.imu[ROLL_RATE])) >= MIN_ROLL_RATE

    def tick(self, t_ns: int) -> list[GroundDrift | Event]:
        """Compare a look that is complete; repeat the last output; events."""
        looks = self._looks.take(t_ns, self._aided.newest_ns)
        if looks is not None:
            self._drift = replace(self._compare(looks, t_ns), t_ns=t_ns)
        out: list[GroundDrift | Event] = [*self._events]
        self._events.clear()
        if looks is not None or t_ns - self._sent_ns >= REPEAT_NS:
            self._sent_ns = t_ns
            out.append(self._repeat(t_ns))
        return out

    # ----------------------------------------------------------------------------------------------------------- pairs

    def _compare(self, looks: Sequence[CollectedLook], t_ns: int) -> GroundDrift:
        """Compare a look with the first of its pair, and let the drift aid.  looks : of the devices, of one time"""
        look_ns = looks[0].t_ns
        estimate = self._aided.estimate(look_ns)
        path = self._aided.path(pose_times_ns(looks))
        output = GroundDrift(t_ns=t_ns, t_valid_ns=look_ns, valid=False, reasons=(), points=len(looks[-1].ranges))
        if estimate is None or path is None:
            self._restart()
            self._looks.wait(None)
            return replace(output, reasons=(Reason.NO_POSITION,))
        images = [
            thin(as_image(look, path, lever_arm_b, self._settings.range_sd_m), estimate)
            for look, lever_arm_b in zip(looks, self._lever_arms_b.values(), strict=True)
        ]
        self._looks.wait(interval_ns(images, estimate))
        if self._look_ns is not None and look_ns - self._look_ns > MAX_GAP_NS:
            self._pairs.clear()
        self._look_ns = look_ns
        result = self._pairs.feed(estimate, images, mean_rate(path))
        output = replace(output, points=len(images[-1].ranges), **_sensor_errors(estimate))
        if result.drift is None:
            self._aided.feed_look(look_ns, result.mark)
            return replace(output, reasons=(Reason.NOTHING_TO_COMPARE,))
        return self._use(result, complete_drift(output, result.drift, estimate), estimate)

    def _restart(self) -> None:
        """The filter has no position: looks, and what it knew of the sensor, are lost."""
        self._pairs.clear()
        self._calibration.restart()
        self._diagnosis.clear()

    def _use(self, result: PairResult, output: GroundDrift, before: Estimate) -> GroundDrift:
        """Let a drift aid if nothing refuses it; mark the look after it.  before : the filter's estimate without it"""
        assert output.t_valid_ns is not None
        reasons = self._refusal_reasons(result, output.t_valid_ns, before)
        self._aided.feed_look(output.t_valid_ns, result.mark)
        self._counts = [self._counts[0] + 1, self._counts[1] + bool(reasons)]
        return replace(output, valid=not reasons, reasons=reasons)

    def _refusal_reasons(self, result: PairResult, t_ns: int, before: Estimate) -> tuple[Reason, ...]:
        """Why a drift does not aid; it has been given to the filter."""
        assert result.drift is not None
        if result.aiding is None:
            if Refusal.UNEXPECTED in result.drift.refusals:
                self._contradict(t_ns)
            return tuple(REASON_OF[refusal] for refusal in result.drift.refusals) or (Reason.LOOKS_MISFIT,)
        has_satellites = self._aided.has_satellites(t_ns, SATELLITES_NS)
        if not (self._calibration.is_complete or has_satellites):
            return self._calibration.reasons
        reasons = self._calibration.reasons
        self._aided.feed_look(t_ns, with_fields(result.aiding, is_on_trial=not self._calibration.is_complete))
        after = self._aided.estimate(t_ns)
        cause = "" if after is None else excessive_error(after)
        if not self._aided.is_accepted(SCAN_DRIFT, t_ns) or after is None or cause:
            self._diagnosis.feed(result.aiding, before)
            self._contradict(t_ns, cause)
            return (Reason.REJECTED, *self._calibration.reasons)
        knows_heading = after.rpy_sd[2] <= MAX_HEADING_SD
        if has_satellites and knows_heading and self._calibration.agree(t_ns, knows_clock=knows_clock(after)):
            self._diagnosis.clear()
            self._is_explained = False
            self._report(t_ns, "info", "its pairs agree with satellites; it aids the filter")
        return reasons

    def _contradict(self, t_ns: int, cause: str = "") -> None:
        """A pair contradicts the filter.  cause : the error of the sensor that is too large, ""  if none is"""
        begins = self._calibration.contradict(t_ns)
        if not self._calibration.is_contradicting or (self._is_explained and not begins):
            return
        cause = cause or self._diagnosis.cause()
        if begins:
            self._aided.feed_look(t_ns, SensorReset())  # what is known of the sensor may be wrong
        if begins or cause:
            self._is_explained = bool(cause)
            reason = cause or "its mounting, clock or ranges are wrong, or the filter is"
            names = " and ".join(self._lever_arms_b)
            text = f"pairs of {names} contradict the filter: {reason}; it aids again after a calibration"
            self._report(t_ns, "warning", text)

    def _report(self, t_ns: int, level: str, text: str) -> None:
        self._events.append(Event(t_ns=t_ns, level=level, source="nav", text=f"{NAME}: {text}"))

    def _repeat(self, t_ns: int) -> GroundDrift:
        """The last drift as an output of this time."""
        pairs, refused = self._counts
        if self._drift is None:
            return GroundDrift(t_ns=t_ns, t_valid_ns=None, valid=False, reasons=(Reason.SILENT,))
        age_ns, interval = t_ns - (self._drift.t_valid_ns or 0), self._drift.interval
        if age_ns > (MAX_GAP_NS if interval is None else MAX_AGE_INTERVALS * interval * SECOND_NS):
            self._drift = replace(self._drift, valid=False, reasons=(Reason.STALE,))
        return replace(self._drift, t_ns=t_ns, pairs=pairs, refused=refused)


def knows_clock(estimate: Estimate) -> bool:
    """Whether the time of the scans is known so well that a roll does not hide a wrong clock."""
    clock_sd = estimate.drift_sd(CLOCK)
    return clock_sd is not None and clock_sd <= MAX_CLOCK_SD


def excessive_error(estimate: Estimate) -> str:
    """The error of the sensor that is larger than a sound sensor has; "" if none is.

    The estimate is freed of the sigma of a sound sensor, which draws it to zero: information is 1 / variance.
    """
    for name, (drift, limit) in LIMITS_OF_ERRORS.items():
        sd = estimate.drift_sd(name)
        share = 0.0 if sd is None else 1.0 - (sd / drift.sd) ** 2  # of the pairs in the information
        if sd is None or share < MIN_SHARE_OF_PAIRS:
            continue
        value = estimate.drift(name) / share
        if abs(value) > max(limit, MIN_SIGMAS * sd / math.sqrt(share)):
            return describe(name, value)
    return ""


def _sensor_errors(estimate: Estimate) -> dict[str, float | None]:
    """The errors of the sensor that the filter estimates, and their sigmas."""
    known = {field: name for field, name in ERRORS_OF_FIELDS.items() if name in estimate.model.columns}
    values: dict[str, float | None] = {field: estimate.drift(name) for field, name in known.items()}
    return values | {f"{field}_sd": estimate.drift_sd(name) for field, name in known.items()}


def complete_drift(output: GroundDrift, found: ScanDrift, estimate: Estimate) -> GroundDrift:
    """An output with the drift of a pair, in north, east, down.  estimate : the filter's, at the later look"""
    interval = found.interval if math.isfinite(found.interval) else None
    output = replace(output, directions=len(found.drift), overlap=found.overlap, interval=interval)
    if len(found.drift) < 3:
        return output
    axes_n = _axes_n(found.axes_l)
    north, east, down = (axes_n.T @ found.drift).tolist()
    north_sd, east_sd, down_sd = np.sqrt(np.diag(axes_n.T @ found.cov @ axes_n)).tolist()
    return replace(output, north=north, east=east, down=down, north_sd=north_sd, east_sd=east_sd, down_sd=down_sd)


def _axes_n(axes_l: Array) -> Array:
    """Directions in east, north, up as north, east, down."""
    return np.asarray(axes_l[:, (1, 0, 2)] * [1.0, 1.0, -1.0])

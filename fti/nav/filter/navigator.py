"""Aided inertial navigation: position, velocity and attitude with sigma, mode and reasons, from measurements.

    navigator = InertialNavigator(FilterModel(unit=IMU_ERROR_MODELS["tactical"], extras=GNSS_DRIFTS))
    navigator.feed_inertial(t_valid_ns, accel_b, gyro_b)          every inertial sample, in order
    navigator.feed_aiding(t_valid_ns, GnssPosition(...))          in any order, up to horizon_ns late
    navigator.feed_attitude(t_valid_ns, roll, pitch, heading)     a device's attitude, for the alignment
    navigator.output(t_ns)                                        FilterSolution at t_ns
    navigator.at(t_ns)                                            Estimate with covariance, or None

Pure: the same calls give bit-identical results.  Inputs that are not finite, repeated, older than the horizon or out of
order are refused and counted (``refused``); nothing raises.

Mode: WAITING for inputs; ALIGNING until the next position, height and velocity agree; AIDED; COASTING if no source has
bounded the horizontal or the height for ``COAST_NS``; INVALID without inertial samples or if the position is too
uncertain.  The filter restarts after a gap of inertial samples, a clock jump or divergence, and when a fix lies inside
the gate of a position that is too uncertain; the reason is RESET until it is aligned.
"""

from __future__ import annotations

import math
import operator
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.messages.outputs import FilterMode, FilterSolution
from fti.messages.reasons import Reason
from fti.nav.filter import antenna, kernels
from fti.nav.filter.aiding import Aiding, GnssHeight, GnssPosition, SlantRange
from fti.nav.filter.delayed_measurements import HORIZON_NS, InnovationRecord, Timeline
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate, InitialState, inflate_covariance
from fti.nav.filter.exclusion import NOT_EXCLUDED, Cause, Exclusion
from fti.nav.filter.initial_alignment import Aligner
from fti.nav.filter.innovation_gate import LIMITS, GateStates, excluded_names, rejected_names
from fti.nav.filter.measurement_update import compute_nis
from fti.nav.filter.position_mark import TERRAIN_POSITION
from fti.nav.filter.segment import FilterSegment

#: Longest gap between inertial samples that is bridged.
MAX_GAP_NS = 200_000_000
#: More consecutive samples from the past are a clock jump.
MAX_BACKWARD_SAMPLES = 20
COAST_NS = 2_000_000_000
#: A position from a height profile is known once per profile.
COAST_NS_OF = {TERRAIN_POSITION: 60_000_000_000}
#: A less certain position is not valid [m, one sigma].
MAX_SD_M = 2000.0
#: Limits of plausible inertial samples [m/s^2, rad/s], and of altitude [m over a sphere] and speed [m/s].
MAX_IMU = (500.0, 500.0, 500.0, 50.0, 50.0, 50.0)
MAX_ALT_M, MAX_SPEED_MPS = 1e5, 2000.0
#: Limit of plausible values of a measurement in SI units.
MAX_VALUE = 1e9
#: Quantities that must be accepted once to confirm an alignment, by the ends of their names.
CONFIRMING_QUANTITIES = (".position", ".height", ".velocity")
#: Sigma of a device's attitude if it states none [rad].
ATTITUDE_SD = (math.radians(0.5), math.radians(0.5), math.radians(2.0))


class InertialNavigator:
    """One filter.  horizon_ns : measurements may be so late, and the estimates of so long are known"""

    def __init__(self, model: FilterModel, horizon_ns: int = HORIZON_NS) -> None:
        self.model, self._horizon_ns = model, horizon_ns
        self.refused: Counter[Reason] = Counter()
        self._aligner = Aligner()
        self._timeline: Timeline | None = None
        self._missing: tuple[Reason, ...] = (Reason.NO_IMU,)
        self._newest_ns: int | None = None
        self._backward_count = 0
        self._restart_reason: Reason | None = None
        self._unconfirmed = frozenset[str]()  # names of the initial sources, until they agree

    # ----------------------------------------------------------------------------------------------------------- inputs

    def begin(self, t_ns: int, start: InitialState, accel_b: ArrayLike, gyro_b: ArrayLike) -> None:
        """Begin with a known state at an inertial sample."""
        self._newest_ns, self._restart_reason, self._unconfirmed = t_ns, None, frozenset()
        imu = np.concatenate((np.asarray(accel_b, dtype=np.float64), np.asarray(gyro_b, dtype=np.float64)))
        self._timeline = Timeline(start.estimate(t_ns, imu, self.model), self._horizon_ns)

    def feed_inertial(self, t_ns: int, accel_b: Iterable[float], gyro_b: Iterable[float]) -> None:
        """Specific force (3,) [m/s^2] and turn rate (3,) [rad/s], body axes at P, valid at t_ns."""
        values = (*accel_b, *gyro_b)
        if len(values) != len(MAX_IMU) or not all(map(operator.lt, map(abs, values), MAX_IMU)):  # NaN, too
            self.refused[Reason.DEVICE_FLAG] += 1
            return
        if self._newest_ns is not None and t_ns <= self._newest_ns:
            self._refuse_backward_sample()
            return
        self._backward_count = 0
        if self._newest_ns is not None and t_ns - self._newest_ns > MAX_GAP_NS:
            self._restart(Reason.NO_IMU)
        self._newest_ns, imu = t_ns, np.array(values, dtype=np.float64)
        if self._timeline is None:
            self._align(t_ns, imu)
            return
        self._timeline.step(t_ns, imu)
        if not _is_plausible(self._timeline.replay_newest().estimate):
            self._restart(Reason.DIVERGED)
        elif self._unconfirmed:
            self._confirm()

    def feed_aiding(self, t_ns: int, aiding: Aiding) -> None:
        """A measurement, valid at t_ns; horizontal position and height pass the gate separately."""
        if not is_known(aiding):
            self.refused[Reason.DEVICE_FLAG] += 1
            return
        if self._is_lost(aiding):
            self._restart(Reason.COASTING)
        if self._timeline is None:
            self._aligner.feed_aiding(t_ns, aiding)
        elif not self._timeline.feed_aiding(t_ns, *(aiding.split() if isinstance(aiding, GnssPosition) else (aiding,))):
            self.refused[Reason.STALE] += 1

    def feed_attitude(
        self,
        t_ns: int,
        roll: float,
        pitch: float,
        heading: float | None,
        sd: tuple[float, float, float] = ATTITUDE_SD,
    ) -> None:
        """A device's attitude [rad] and its sigma: used for the alignment, not afterwards."""
        if not all(map(math.isfinite, (roll, pitch, heading or 0.0, *sd))) or not min(sd) > 0.0:
            self.refused[Reason.DEVICE_FLAG] += 1
        elif self._timeline is None:
            self._aligner.feed_attitude(t_ns, (roll, pitch, heading), sd)

    # ---------------------------------------------------------------------------------------------------------- outputs

    def at(self, t_ns: int) -> Estimate | None:
        """The estimate at t_ns, at most the horizon before the newest sample, ``MAX_GAP_NS`` after it; else None."""
        return self._timeline.at(t_ns) if self._timeline is not None and self.reaches(t_ns) else None

    def path(self, times_ns: Sequence[int]) -> list[Estimate] | None:
        """Estimates at ascending times that no measurement corrects in between, where ``at`` has estimates."""
        if self._timeline is None or not (self.reaches(times_ns[0]) and self.reaches(times_ns[-1])):
            return None
        return self._timeline.path(times_ns)

    def find_exclusions(self) -> dict[str, Exclusion]:
        """Excluded sources with cause and time, by name."""
        return {name: s.exclusion for name, s in self.gate_states.items() if s.exclusion.cause is not None}

    @property
    def gate_states(self) -> GateStates:
        """The states of the gate by name of a source: the same object until the next measurement."""
        return self._timeline.replay_newest().gate_states if self._timeline is not None else {}

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest inertial sample; None before the first one."""
        return self._newest_ns

    @property
    def is_aligned(self) -> bool:
        """Whether the initial state was confirmed, and the filter has not restarted since."""
        return self._timeline is not None and not self._unconfirmed

    def drain_segments(self) -> list[FilterSegment]:
        """Segments that became final since the last call, by the horizon late; see ``fti.nav.filter.segment``."""
        return self._timeline.drain_segments() if self._timeline is not None else []

    def find_last_final(self) -> Estimate | None:
        """The estimate at the end of the last segment; exclusions and readmissions replace it."""
        return self._timeline.replay_first().estimate if self._timeline is not None else None

    def exclude(self, names: Iterable[str], since_ns: int, estimate: Estimate | None) -> None:
        """Exclude sources, and continue without them from an estimate at the end of the last segment.

        names : of ``Aiding``;  since_ns : start of their contradiction;  estimate : None: that of the filter
        """
        if self._timeline is not None:
            exclusion = Exclusion(since_ns, Cause.SEPARATION)
            initial = self._timeline.replay_first().estimate if estimate is None else estimate
            self._timeline.replace_first(initial, [(name, exclusion) for name in names])

    def readmit(self, names: Iterable[str], disagreement: float = 0.0) -> None:
        """Readmit excluded sources.  disagreement : possible error of the filter itself [m]"""
        if self._timeline is not None:
            initial = self._timeline.replay_first().estimate
            self._timeline.replace_first(
                inflate_covariance(initial, disagreement), [(name, NOT_EXCLUDED) for name in names]
            )

    def restart(self, reason: Reason) -> None:
        """Restart, because the estimate is known to be wrong."""
        self._restart(reason)

    def reaches(self, t_ns: int) -> bool:
        """Whether there is an estimate at t_ns, without computing it."""
        timeline = self._timeline
        return timeline is not None and timeline.oldest_ns <= t_ns <= timeline.newest_ns + MAX_GAP_NS

    def drain_innovations(self) -> list[InnovationRecord]:
        """The gate decisions of measurements since the last call."""
        return self._timeline.drain_innovations() if self._timeline else []

    def mode(self, t_ns: int) -> tuple[FilterMode, tuple[Reason, ...]]:
        """Mode of the filter, and its reasons."""
        if self._newest_ns is None or t_ns - self._newest_ns > MAX_GAP_NS:
            return (FilterMode.INVALID if self._timeline else FilterMode.WAITING), (Reason.NO_IMU,)
        if self._timeline is None:
            again = (Reason.RESET,) if self._restart_reason else ()
            mode = FilterMode.WAITING if Reason.NO_GNSS in self._missing else FilterMode.ALIGNING
            return mode, (Reason.ALIGNING, *self._missing, *again)
        if self._unconfirmed:
            return FilterMode.ALIGNING, (Reason.ALIGNING,)
        newest = self._timeline.replay_newest()
        states = newest.gate_states
        table = ((Reason.REJECTED, rejected_names(states)), (Reason.EXCLUDED, excluded_names(states)))
        reasons = tuple(reason for reason, names in table if names)
        if max(newest.estimate.sd_n[:3]) > MAX_SD_M:
            return FilterMode.INVALID, (Reason.COASTING, *reasons)
        if self._bounded_axes(t_ns) != {"horizontal", "vertical"}:
            return FilterMode.COASTING, (Reason.COASTING, *reasons)
        return FilterMode.AIDED, reasons

    def output(self, t_ns: int) -> FilterSolution:
        """The output at t_ns.  It is valid if AIDED or COASTING, with its sigma."""
        mode, reasons = self.mode(t_ns)
        estimate = self.at(t_ns) if mode in {FilterMode.AIDED, FilterMode.COASTING} else None
        if estimate is not None and not _is_plausible(estimate):  # diverged; the next sample restarts the filter
            estimate, mode, reasons = None, FilterMode.INVALID, (Reason.DIVERGED,)
        if estimate is None:
            reported = reasons or (Reason.STALE,)
            return FilterSolution(t_ns=t_ns, t_valid_ns=None, valid=False, reasons=reported, mode=mode)
        assert self._timeline is not None
        (lat, lon, alt), (roll, pitch, heading), rpy_sd = estimate.geodetic, estimate.rpy, estimate.rpy_sd
        (north, east, down), sd = estimate.vel_n.tolist(), estimate.sd_n
        states = self._timeline.replay_newest().gate_states
        return FilterSolution(
            t_ns=t_ns, t_valid_ns=estimate.t_ns, valid=True, reasons=reasons, mode=mode,
            lat=lat, lon=lon, alt=alt, horizontal_sd=float(max(sd[0], sd[1])), vertical_sd=float(sd[2]),
            vel_north=north, vel_east=east, vel_down=down, vel_sd=float(max(sd[3:6])),
            roll=roll, pitch=pitch, heading=heading, tilt_sd=max(rpy_sd[:2]), heading_sd=rpy_sd[2],
            rejected=rejected_names(states), excluded=excluded_names(states),
        )  # fmt: skip

    # -------------------------------------------------------------------------------------------------------- internals

    def _is_lost(self, aiding: Aiding) -> bool:
        """Whether the position is too uncertain, and a fix of an admitted receiver is inside its gate.

        A correction by tens of kilometres is along the tangent of the Earth: 57 km raise the altitude by 255 m.
        """
        if self._timeline is None or not isinstance(aiding, GnssPosition):
            return False
        if max(self._timeline.newest_without_replay.estimate.sd_n[:2]) <= MAX_SD_M:
            return False
        estimate, gate_states = self._timeline.replay_newest()
        state = gate_states.get(aiding.name)
        if max(estimate.sd_n[:2]) <= MAX_SD_M or (state is not None and state.exclusion.cause is not None):
            return False
        horizontal = replace(aiding, alt=None).compute_matrices(estimate)
        return compute_nis(estimate, horizontal) <= LIMITS[2]

    def _bounded_axes(self, t_ns: int) -> frozenset[str]:
        """Axes that a source has bounded within ``COAST_NS``."""
        assert self._timeline is not None
        gate_states = self._timeline.replay_newest().gate_states
        recent = [
            s
            for name, s in gate_states.items()
            if s.accepted_ns is not None and t_ns - s.accepted_ns <= COAST_NS_OF.get(name, COAST_NS)
        ]
        return frozenset[str]().union(*(s.bounds for s in recent))

    def _align(self, t_ns: int, imu: Array) -> None:
        self._aligner.feed_inertial(t_ns, imu)
        start = self._aligner.start(t_ns)
        if isinstance(start, Reason):
            self._missing = (start,)
            return
        self.begin(t_ns, start, imu[:3], imu[3:])
        self._unconfirmed = self._aligner.names

    def _confirm(self) -> None:
        """Confirm the initial state: the next fix of its sources must agree, or the filter restarts.

        Other devices can confirm it; their disagreement is ignored.
        """
        assert self._timeline is not None
        gate_states = self._timeline.replay_newest().gate_states
        accepted = [name for name, s in gate_states.items() if s.accepted_ns is not None]
        if not self._unconfirmed.isdisjoint(rejected_names(gate_states)):
            self._restart(Reason.REJECTED)
        elif all(any(name.endswith(kind) for name in accepted) for kind in CONFIRMING_QUANTITIES):
            self._unconfirmed = frozenset()

    def _refuse_backward_sample(self) -> None:
        """A sample from the past: it is refused; many are a clock jump."""
        self.refused[Reason.STALE] += 1
        self._backward_count += 1
        if self._backward_count > MAX_BACKWARD_SAMPLES:
            self._restart(Reason.STALE)
            self._newest_ns = None

    def _restart(self, reason: Reason) -> None:
        if self._timeline is not None:
            self._restart_reason = reason
        self._timeline, self._aligner, self._missing, self._backward_count = None, Aligner(), (reason,), 0


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    estimate = InitialState(0.0, 0.0, 0.0, (0.0,) * 3, 0.0, 0.0, 0.0, (1.0,) * 3, (1.0,) * 3, (0.1,) * 3).estimate(
        0, np.zeros(6), FilterModel()
    )
    y, P = estimate.y, estimate.P
    still = np.zeros(6)
    kernels.step(
        y,
        P,
        still,
        still,
        kernels.second_derivatives(still, still, still, 0.01, 0.01),
        FilterModel().unit.table,
        FilterModel().drifts,
        0.01,
    )
    rows = np.zeros((1, 6))
    kernels.resample(np.arange(2.0), np.zeros((2, 6)), np.arange(2.0))
    kernels.coast(y, P, rows, rows, rows, FilterModel().unit.table, FilterModel().drifts, np.full(1, 0.01))
    kernels.matrix(y)
    kernels.separate(y, P, y, P, estimate.mat_en, 0.1)
    kernels.largest_sd(1.0, 1.0, 0.0)
    kernels.health(y, P)
    antenna.warm_up()
    x = np.zeros(len(P))
    kernels.fuse(x, P, np.zeros(1), np.zeros((1, len(P))), np.eye(1))
    kernels.consider(x, P, 0.0, np.zeros(len(P)), 1.0, np.ones(len(P)))
    kernels.correct(y, x, 0)


def is_known(aiding: Aiding) -> bool:
    """Whether all values are finite and plausible, all sigmas positive, and the observation is usable."""
    if isinstance(aiding, SlantRange) and not aiding.meets_ground:
        return False
    if isinstance(aiding, GnssHeight):
        return is_known(aiding.position)
    if (conceivable := getattr(aiding, "is_conceivable", None)) is not None:
        return bool(conceivable)
    fields = aiding.__dataclass_fields__  # type: ignore[attr-defined]
    return all(_is_conceivable(name, getattr(aiding, name)) for name in fields if name != "own_drifts")


def _is_conceivable(name: str, value: object) -> bool:
    """Whether a field is plausible; names and None are."""
    if isinstance(value, str) or value is None:
        return True
    if isinstance(value, tuple):
        return all(_is_conceivable(name, x) for x in value)
    number = float(value)  # type: ignore[arg-type]
    return abs(number) < MAX_VALUE and (number > 0.0 or not name.endswith("sd"))


def _is_plausible(estimate: Estimate) -> bool:
    """Whether the estimate is finite and near the Earth."""
    numbers, height, speed = kernels.health(estimate.y, estimate.P)
    return numbers and abs(height) < MAX_ALT_M and speed < MAX_SPEED_MPS

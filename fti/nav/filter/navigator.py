"""Inertial navigation, aided: measurements in, and position, velocity, attitude with their sigma, mode and reasons out.

    navigator = Navigator(Model(unit=UNITS["tactical"], extras=GNSS_DRIFTS))
    navigator.take_inertial(t_valid_ns, accel_b, gyro_b)          every inertial sample, in order
    navigator.take(t_valid_ns, GnssPosition(...))                 what aids, in any order, up to a second late
    navigator.take_attitude(t_valid_ns, roll, pitch, heading)     a device's attitude: it is aligned with it
    navigator.output(t_ns)                                        FilterSolution at t_ns
    navigator.at(t_ns)                                            Estimate with covariance, or None

Pure: the same calls give the same answers, to the last bit.  What is no number, comes twice, from before the horizon or
out of order is refused and counted (``refused``); nothing raises.

Mode: WAITING for inputs, ALIGNING when they come and until the next position, height and velocity agree, AIDED,
COASTING where nothing has bounded the horizontal or the height for ``COAST_NS``, INVALID where nothing is felt any more
or the position has become too uncertain.  A gap of inertial samples, a clock that jumps, numbers that leave the world,
or a fix inside the gate of a position that is too uncertain begin anew, with the reason RESET until it is aligned.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.nav.filter import antenna, geodetic_kernels, kernels
from fti.nav.filter.aiding import Aiding, GnssHeight, GnssPosition, SlantRange
from fti.nav.filter.delayed_measurements import InnovationRecord, Timeline
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate, InitialState, inflate_covariance
from fti.nav.filter.exclusion import NOT_EXCLUDED, Cause, Exclusion
from fti.nav.filter.initial_alignment import Aligner
from fti.nav.filter.innovation_gate import LIMITS, excluded, rejected
from fti.nav.filter.measurement_update import compute_nis
from fti.nav.filter.segment import FilterSegment
from fti.types import FilterMode, FilterSolution, Reason

Array = NDArray[np.float64]

#: A longer gap between inertial samples cannot be bridged.
MAX_GAP_NS = 200_000_000
#: So many samples in a row from the past are a clock that has jumped.
MAX_BACKWARD_SAMPLES = 20
COAST_NS = 2_000_000_000
#: Less certain than this a position is none [m, one sigma].
MAX_SD_M = 2000.0
#: What no inertial unit on an aircraft feels [m/s^2, rad/s], and where none flies [m beside a sphere, m/s].
MAX_IMU = np.array([500.0] * 3 + [50.0] * 3)
MAX_ALT_M, MAX_SPEED_MPS = 1e5, 2000.0
#: No number of a measurement in SI units is larger.
MAX_VALUE = 1e9
#: What must be believed once before an alignment counts, by the ends of its names.
CONFIRMING_QUANTITIES = (".position", ".height", ".velocity")
#: Sigma of a device's attitude that states none [rad].
ATTITUDE_SD = (math.radians(0.5), math.radians(0.5), math.radians(2.0))


class InertialNavigator:
    """One filter."""

    def __init__(self, model: FilterModel) -> None:
        self.model = model
        self.refused: Counter[Reason] = Counter()
        self._aligner = Aligner()
        self._timeline: Timeline | None = None
        self._missing: tuple[Reason, ...] = (Reason.NO_IMU,)
        self._newest_ns: int | None = None
        self._backward_count = 0
        self._restart_reason: Reason | None = None
        self._unconfirmed = frozenset[str]()  # names of what it began with, until they agree

    # ---------------------------------------------------------------------------------------------------- taking

    def begin(self, t_ns: int, start: InitialState, accel_b: ArrayLike, gyro_b: ArrayLike) -> None:
        """Begin with a known state at an inertial sample."""
        self._newest_ns, self._restart_reason, self._unconfirmed = t_ns, None, frozenset()
        imu = np.concatenate((np.asarray(accel_b, dtype=np.float64), np.asarray(gyro_b, dtype=np.float64)))
        self._timeline = Timeline(start.estimate(t_ns, imu, self.model))

    def feed_inertial(self, t_ns: int, accel_b: Iterable[float], gyro_b: Iterable[float]) -> None:
        """Specific force (3,) [m/s^2] and turn rate (3,) [rad/s], body axes at P, true at t_ns."""
        imu = np.array((*accel_b, *gyro_b), dtype=np.float64)  # of tuples a third of joining two arrays
        if imu.shape != (6,) or not kernels.is_within(imu, MAX_IMU):
            self.refused[Reason.DEVICE_FLAG] += 1
            return
        if self._newest_ns is not None and t_ns <= self._newest_ns:
            self._step_back()
            return
        self._backward_count = 0
        if self._newest_ns is not None and t_ns - self._newest_ns > MAX_GAP_NS:
            self._restart(Reason.NO_IMU)
        self._newest_ns = t_ns
        if self._timeline is None:
            self._align(t_ns, imu)
            return
        self._timeline.step(t_ns, imu)
        if not _is_plausible(self._timeline.newest.estimate):
            self._restart(Reason.DIVERGED)
        elif self._unconfirmed:
            self._confirm()

    def feed_aiding(self, t_ns: int, aiding: Aiding) -> None:
        """What aids, true at t_ns; level and height of a position are judged each for itself."""
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
        """A device's attitude [rad] and its sigma: the filter is aligned with it, and does not use it afterwards."""
        if not all(map(math.isfinite, (roll, pitch, heading or 0.0, *sd))) or not min(sd) > 0.0:
            self.refused[Reason.DEVICE_FLAG] += 1
        elif self._timeline is None:
            self._aligner.feed_attitude(t_ns, (roll, pitch, heading), sd)

    # --------------------------------------------------------------------------------------------------- telling

    def at(self, t_ns: int) -> Estimate | None:
        """The estimate at t_ns, of the last second or ``MAX_GAP_NS`` ahead; None where there is none."""
        return self._timeline.at(t_ns) if self._timeline is not None and self.reaches(t_ns) else None

    @property
    def exclusions(self) -> dict[str, Exclusion]:
        """Why and since when sources are excluded at present, by name."""
        gate_states = self._timeline.newest.gate_states if self._timeline is not None else {}
        return {name: s.exclusion for name, s in gate_states.items() if s.exclusion.cause is not None}

    def accepted_ns(self, axis: str) -> dict[str, int]:
        """When each source that bounds an axis was believed last, by name."""
        gate_states = self._timeline.newest.gate_states if self._timeline is not None else {}
        return {
            name: s.accepted_ns for name, s in gate_states.items() if s.accepted_ns is not None and axis in s.bounds
        }

    @property
    def is_aligned(self) -> bool:
        """Whether what it began with was confirmed, and it has not restarted since."""
        return self._timeline is not None and not self._unconfirmed

    def drain_segments(self) -> list[FilterSegment]:
        """What became final since the last call, a second behind; see ``fti.nav.filter.segment``."""
        return self._timeline.drain_segments() if self._timeline is not None else []

    @property
    def last_final(self) -> Estimate | None:
        """The estimate where the last segment ends: the one that exclusions and readmissions replace."""
        return self._timeline.first.estimate if self._timeline is not None else None

    def exclude(self, names: Iterable[str], since_ns: int, estimate: Estimate | None) -> None:
        """Exclude sources, and go on without them from an estimate at the end of the last segment.

        names : of ``Aiding``;  since_ns : when their contradiction began;  estimate : None: that of the filter
        """
        if self._timeline is not None:
            exclusion = Exclusion(since_ns, Cause.SEPARATION)
            here = self._timeline.first.estimate if estimate is None else estimate
            self._timeline.replace_first(here, [(name, exclusion) for name in names])

    def readmit(self, names: Iterable[str], disagreement: float = 0.0) -> None:
        """Let excluded sources aid again.  disagreement : up to so much [m] the filter itself may be wrong"""
        if self._timeline is not None:
            here = self._timeline.first.estimate
            self._timeline.replace_first(
                inflate_covariance(here, disagreement), [(name, NOT_EXCLUDED) for name in names]
            )

    def restart(self, why: Reason) -> None:
        """Begin anew: what it holds is known to be wrong."""
        self._restart(why)

    def reaches(self, t_ns: int) -> bool:
        """Whether there is an estimate at t_ns, without making it."""
        timeline = self._timeline
        return timeline is not None and timeline.oldest_ns <= t_ns <= timeline.newest_ns + MAX_GAP_NS

    def drain_innovations(self) -> list[InnovationRecord]:
        """What became of each measurement since it was asked last."""
        return self._timeline.drain_innovations() if self._timeline else []

    def mode(self, t_ns: int) -> tuple[FilterMode, tuple[Reason, ...]]:
        """State of the filter, and why it is not better."""
        if self._newest_ns is None or t_ns - self._newest_ns > MAX_GAP_NS:
            return (FilterMode.INVALID if self._timeline else FilterMode.WAITING), (Reason.NO_IMU,)
        if self._timeline is None:
            again = (Reason.RESET,) if self._restart_reason else ()
            mode = FilterMode.WAITING if Reason.NO_GNSS in self._missing else FilterMode.ALIGNING
            return mode, (Reason.ALIGNING, *self._missing, *again)
        if self._unconfirmed:
            return FilterMode.ALIGNING, (Reason.ALIGNING,)
        newest = self._timeline.newest
        table = ((Reason.REJECTED, rejected(newest.gate_states)), (Reason.EXCLUDED, excluded(newest.gate_states)))
        reasons = tuple(reason for reason, names in table if names)
        if max(newest.estimate.sd_n[:3]) > MAX_SD_M:
            return FilterMode.INVALID, (Reason.COASTING, *reasons)
        if self._bounded(t_ns) != {"horizontal", "vertical"}:
            return FilterMode.COASTING, (Reason.COASTING, *reasons)
        return FilterMode.AIDED, reasons

    def output(self, t_ns: int) -> FilterSolution:
        """What is told at t_ns.  Valid when AIDED or COASTING: the sigma says how good it is."""
        mode, reasons = self.mode(t_ns)
        here = self.at(t_ns) if mode in {FilterMode.AIDED, FilterMode.COASTING} else None
        if here is not None and not _is_plausible(
            here
        ):  # what aids has led out of the world; the next sample begins anew
            here, mode, reasons = None, FilterMode.INVALID, (Reason.DIVERGED,)
        if here is None:
            told = reasons or (Reason.STALE,)
            return FilterSolution(t_ns=t_ns, t_valid_ns=None, valid=False, reasons=told, mode=mode)
        assert self._timeline is not None
        (lat, lon, alt), (north, east, down), (roll, pitch, heading) = here.place, here.vel_n.tolist(), here.rpy
        sd, turned = here.sd_n, here.rpy_sd
        return FilterSolution(
            t_ns=t_ns, t_valid_ns=here.t_ns, valid=True, reasons=reasons, mode=mode,
            lat=lat, lon=lon, alt=alt, horizontal_sd=float(max(sd[0], sd[1])), vertical_sd=float(sd[2]),
            vel_north=north, vel_east=east, vel_down=down, vel_sd=float(max(sd[3:6])),
            roll=roll, pitch=pitch, heading=heading, tilt_sd=max(turned[:2]), heading_sd=turned[2],
            rejected=rejected(self._timeline.newest.gate_states), excluded=excluded(self._timeline.newest.gate_states),
        )  # fmt: skip

    # -------------------------------------------------------------------------------------------------- in here

    def _is_lost(self, aiding: Aiding) -> bool:
        """Whether the filter has no position any more, and a fix of a believed receiver would give it one.

        A correction by tens of kilometres is along the tangent of the Earth: 57 km raise the altitude by 255 m.
        """
        if self._timeline is None or not isinstance(aiding, GnssPosition):
            return False
        if max(self._timeline.newest_without_replay.estimate.sd_n[:2]) <= MAX_SD_M:
            return False
        here, gate_states = self._timeline.newest
        standing = gate_states.get(aiding.name)
        if max(here.sd_n[:2]) <= MAX_SD_M or (standing is not None and standing.exclusion.cause is not None):
            return False
        level = replace(aiding, alt=None).compute_matrices(here)
        return compute_nis(here, level) <= LIMITS[2]

    def _bounded(self, t_ns: int) -> frozenset[str]:
        """Which axes something has bounded lately."""
        assert self._timeline is not None
        gate_states = self._timeline.newest.gate_states.values()
        lately = [s for s in gate_states if s.accepted_ns is not None and t_ns - s.accepted_ns <= COAST_NS]
        return frozenset[str]().union(*(s.bounds for s in lately))

    def _align(self, t_ns: int, imu: Array) -> None:
        self._aligner.feed_inertial(t_ns, imu)
        start = self._aligner.start(t_ns)
        if isinstance(start, Reason):
            self._missing = (start,)
            return
        self.begin(t_ns, start, imu[:3], imu[3:])
        self._unconfirmed = self._aligner.names

    def _confirm(self) -> None:
        """One fix is no fix: of the devices that it began with the next one must agree, or one of the two is wrong.

        What another device says may be what is wrong, and hinders nobody; it confirms as well.
        """
        assert self._timeline is not None
        gate_states = self._timeline.newest.gate_states
        believed = [name for name, s in gate_states.items() if s.accepted_ns is not None]
        if not self._unconfirmed.isdisjoint(rejected(gate_states)):
            self._restart(Reason.REJECTED)
        elif all(any(name.endswith(kind) for name in believed) for kind in CONFIRMING_QUANTITIES):
            self._unconfirmed = frozenset()

    def _step_back(self) -> None:
        """A sample from the past: one is refused, many are a clock that has jumped."""
        self.refused[Reason.STALE] += 1
        self._backward_count += 1
        if self._backward_count > MAX_BACKWARD_SAMPLES:
            self._restart(Reason.STALE)
            self._newest_ns = None

    def _restart(self, why: Reason) -> None:
        if self._timeline is not None:
            self._restart_reason = why
        self._timeline, self._aligner, self._missing, self._backward_count = None, Aligner(), (why,), 0


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
    kernels.separate(y, P, y, P, estimate.mat_en, 0.1)
    kernels.is_within(np.zeros(6), MAX_IMU)
    kernels.health(y, P)
    geodetic_kernels.warm_up()
    antenna.warm_up()
    x = np.zeros(len(P))
    kernels.fuse(x, P, np.zeros(1), np.zeros((1, len(P))), np.eye(1))
    kernels.consider(x, P, 0.0, np.zeros(len(P)), 1.0, np.ones(len(P)))
    kernels.correct(y, x, 0)


def is_known(aiding: Aiding) -> bool:
    """Every number of it is one and conceivable, every sigma is positive, and what it says can be solved for."""
    if isinstance(aiding, SlantRange) and not aiding.meets_ground:
        return False
    if isinstance(aiding, GnssHeight):
        return is_known(aiding.position)
    fields = aiding.__dataclass_fields__  # type: ignore[attr-defined]
    return all(_is_conceivable(name, getattr(aiding, name)) for name in fields if name != "own_drifts")


def _is_conceivable(name: str, value: object) -> bool:
    """Names and what is not told are; of numbers see ``is_known``."""
    if isinstance(value, str) or value is None:
        return True
    if isinstance(value, tuple):
        return all(_is_conceivable(name, x) for x in value)
    number = float(value)  # type: ignore[arg-type]
    return abs(number) < MAX_VALUE and (number > 0.0 or not name.endswith("sd"))


def _is_plausible(estimate: Estimate) -> bool:
    """Still on Earth."""
    numbers, height, speed = kernels.health(estimate.y, estimate.P)
    return numbers and abs(height) < MAX_ALT_M and speed < MAX_SPEED_MPS

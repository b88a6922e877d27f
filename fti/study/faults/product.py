"""The product, fed with a simulated flight: tests of one source, then the filter with its tests between sources.

The solution of the filter is judged once a second: position, protection levels, and ``valid`` as in the output of
navigation, with the default alert limits of a configuration.  Altimeters do not aid here.  Receivers state no
undulation: the simulated Earth does not have that of EGM96, which the product uses.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from fti.arrays import Array, Mask
from fti.config import AlertLimits, Config, parse
from fti.constants import SECOND_NS
from fti.messages.measurements import ImuSample, Measurement, Position, Velocity
from fti.messages.outputs import Event
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.plausibility.monitor import PlausibilityMonitor
from fti.nav.protection import K_RADIAL
from fti.nav.separation.protection import K_MD_RADIAL
from fti.study.faults.cells import Cell
from fti.study.faults.flight import START_NS, SimulatedFlight, Timed

#: The product has three grades; an industrial unit is configured as the coarser one.
UNIT_OF_GRADE = {"industrial": "mems"}
#: Period of the tests between sources and of the solutions [ns].
FOLLOW_NS, SOLUTION_NS = SECOND_NS // 5, SECOND_NS
LIMITS = AlertLimits()


@dataclass(slots=True)
class SeparationCalibration:
    """Sums of (d / sigma)^2 by class of sources, rung and axis, and how many."""

    sums: dict[tuple[str, int], Array] = field(default_factory=dict)
    counts: dict[tuple[str, int], int] = field(default_factory=dict)

    def take(self, what: str, rung: int, ratios: Array) -> None:
        """|d| over sigma of d, shape (6,)."""
        key = what, rung
        self.sums[key] = self.sums.get(key, np.zeros(6)) + ratios**2
        self.counts[key] = self.counts.get(key, 0) + 1

    def add(self, other: SeparationCalibration) -> None:
        """Add the counts of another one."""
        for key, sums in other.sums.items():
            self.sums[key] = self.sums.get(key, np.zeros(6)) + sums
            self.counts[key] = self.counts.get(key, 0) + other.counts[key]


#: Columns of a record: time [s], place [rad, m], levels and sigmas [m], the formula of HPL at d = 0 [m], whether the
#: copies exist (``is_full``), whether a receiver is refused.
COLUMNS = ("t", "lat", "lon", "alt", "hpl", "vpl", "level_sd", "high_sd", "formula", "is_full", "is_refused")


@dataclass(frozen=True, eq=False)
class SolutionRecord:
    """Solutions once a second, rows (n, len(COLUMNS)); events with their time [s]; calibration."""

    rows: Array
    events: tuple[tuple[float, str], ...]
    calibration: SeparationCalibration

    def __getitem__(self, column: str) -> Array:
        """A column, shape (n,)."""
        return np.asarray(self.rows[:, COLUMNS.index(column)])

    @property
    def is_valid(self) -> Mask:
        """Whether both levels are below the alert limits, shape (n,)."""
        return np.asarray((self["hpl"] <= LIMITS.position_m) & (self["vpl"] <= LIMITS.altitude_m))


def make_config(cell: Cell) -> Config:
    """One receiver or two, barometer, inertial unit of the grade, attitude of a device to begin with."""
    receivers = ["gnss_a", "gnss_b"][: cell.receivers]
    names = ["imu", "baro", "ahrs", *receivers]
    table = {
        "session": {"name": "study"},
        "link": [{"name": "line", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, "link": "line", "driver": "none"} for name in names],
        "nav": {
            "attitude": ["ahrs"],
            "position": receivers,
            "filter": {
                "imu": "imu",
                "gnss": receivers,
                "baro": "baro",
                "unit": UNIT_OF_GRADE.get(cell.grade, cell.grade),
            },
        },
    }
    return parse(table, "", Path("study.toml"))


class Product:
    """The product of one aircraft; ``branch`` copies it with its state."""

    def __init__(self, cell: Cell) -> None:
        self._config = make_config(cell)
        devices = {device.name: device for device in self._config.device}
        assert self._config.nav.filter is not None
        self._navigation = AidedNavigation(self._config.nav.filter, devices)
        self._plausibility = PlausibilityMonitor(self._config)
        self._follow_ns = START_NS + FOLLOW_NS
        self._solution_ns = START_NS + SOLUTION_NS

    def branch(self) -> Product:
        """Independent copy; immutable parts are shared."""
        return copy.deepcopy(self, {id(self._config): self._config})

    def fly(self, measurements: Iterable[Timed]) -> SolutionRecord:
        """Feed measurements in order; returns solutions and events."""
        rows, events, calibration = list[tuple[float, ...]](), list[tuple[float, str]](), SeparationCalibration()
        for t_ns, device, m in measurements:
            while t_ns > self._follow_ns:
                events += self._follow(self._follow_ns)
                self._follow_ns += FOLLOW_NS
            while t_ns > self._solution_ns:
                rows += self._solution(self._solution_ns, calibration)
                self._solution_ns += SOLUTION_NS
            events += self._feed(device, m, t_ns)
        return SolutionRecord(np.array(rows).reshape(-1, len(COLUMNS)), tuple(events), calibration)

    def _feed(self, device: str, m: Measurement, t_ns: int) -> Iterator[tuple[float, str]]:
        if isinstance(m, ImuSample):
            self._navigation.feed(device, m, t_ns)
            return
        if isinstance(m, Position):
            m = replace(m, undulation=None, alt_msl=None)
        if isinstance(m, (Position, Velocity)):
            for admitted in self._plausibility.check(device, m, t_ns):
                self._navigation.feed(device, admitted, t_ns)
            yield from _timed_texts(self._plausibility.drain_events())
        elif self._navigation.accepts(device, type(m)):
            self._navigation.feed(device, m, t_ns)

    def _follow(self, t_ns: int) -> list[tuple[float, str]]:
        self._navigation.set_suspects(self._plausibility.find_suspects())
        return list(_timed_texts(self._navigation.events(t_ns)))

    def _solution(self, t_ns: int, calibration: SeparationCalibration) -> list[tuple[float, ...]]:
        """One row; empty while the filter has no solution."""
        found = self._navigation.solution(t_ns)
        if not found.valid or found.hpl is None or found.vpl is None:
            return []
        separations, radial = self._navigation.separations, 0.0
        for what, of_copies in separations.items():
            for rung, separation in enumerate(of_copies):
                calibration.take(what, rung, separation.ratios)
                radial = max(radial, separation.radial_sd)
        assert found.lat is not None and found.lon is not None and found.alt is not None
        assert found.horizontal_sd is not None and found.vertical_sd is not None
        formula = max(K_RADIAL * found.horizontal_sd, K_MD_RADIAL * radial)
        seconds = (t_ns - START_NS) / SECOND_NS
        return [(
            seconds, found.lat, found.lon, found.alt, found.hpl, found.vpl, found.horizontal_sd, found.vertical_sd,
            formula, float(bool(separations)), float(bool(self._navigation.refused)),
        )]  # fmt: skip


def _timed_texts(events: Iterable[Event]) -> Iterator[tuple[float, str]]:
    for event in events:
        yield (event.t_ns - START_NS) / SECOND_NS, event.text


def errors_n(flight: SimulatedFlight, rows: Array) -> Array:
    """North, east, down [m] of the solutions of a record, shape (n, 3)."""
    times_ns = START_NS + np.rint(rows[:, 0] * SECOND_NS).astype(np.int64)
    return flight.errors_n(times_ns, rows[:, 1:4])

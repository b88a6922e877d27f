"""Sources that can confirm a receiver whose contradiction stands, because they share nothing with it.

What a source depends on is declared (``depends_on`` of its device); one that declares nothing confirms nothing.  A fix
by DME stations alone depends on nothing that is shared.  For WITNESS_NS and WITNESS_COUNT fixes without a break

    |z - w| <= K hypot(sigma_z, sigma_w)                    they agree
    |z - w| + K sigma_w < D / 2 and the alert limit         a lie of the size of the contradiction would be seen

z, w : position of the receiver and of the witness;  D : contradiction of the receiver;  K = 4.80, vertically 4.42.
Where the filter refuses both, beyond its protection level and K sigma, the filter is wrong, and begins anew.

Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_witnesses.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from fti.config import AlertLimits, Config, position_sources
from fti.nav.protection import K_AXIS, K_RADIAL, FilterReference, differences
from fti.nav.source_interpolation import AttitudeState, NavSource, PositionState
from fti.types import Measurement, Position, Velocity

WITNESS_NS, WITNESS_COUNT = 30_000_000_000, 30
#: Dependence of a receiver that declares none.
SATELLITES = frozenset({"satellites"})


class Size(NamedTuple):
    """Of a contradiction that stands [m]: horizontally, and in height; None: none there."""

    level: float | None
    height: float | None = None


class Confirmation(NamedTuple):
    """A witness agrees with a receiver.

    tolerance : how far the receiver may be wrong all the same [m]
    is_against_filter : both contradict the filter
    """

    device: str
    witness: str
    tolerance: float
    is_against_filter: bool


@dataclass(slots=True)
class _Agreement:
    """Of a receiver and a witness.  since_ns, fixes : without a break;  newest_ns : of the last fix"""

    since_ns: int
    is_against_filter: bool
    fixes: int = 0
    newest_ns: int = 0

    def take(self, newest_ns: int) -> None:
        """Count a fix once."""
        self.fixes += newest_ns != self.newest_ns
        self.newest_ns = newest_ns

    def has_lasted(self, t_ns: int) -> bool:
        """For long enough, in enough fixes."""
        return t_ns - self.since_ns >= WITNESS_NS and self.fixes >= WITNESS_COUNT


class WitnessMonitor:
    """Of a configuration.  assumed : sigmas of positions that state none, by device [m]

    is_fixed : whether positions by DME alone are a witness, too
    """

    def __init__(self, config: Config, assumed: Mapping[str, tuple[float, float]]) -> None:
        devices = {device.name: device for device in config.device if device.name in position_sources(config.nav)}
        aiding = frozenset(config.nav.filter.gnss) if config.nav.filter else frozenset[str]()
        self._assumed, self._limits = assumed, config.nav.alert_limits
        self._depends = {
            name: SATELLITES if device.depends_on is None else frozenset(device.depends_on)
            for name, device in devices.items()
        }
        declared = {name for name, device in devices.items() if device.depends_on is not None and name not in aiding}
        self._witnesses = tuple(name for name in devices if name in declared)
        self._sources = {name: NavSource(device) for name, device in devices.items()}
        self.has_dme_fix = config.nav.radio is not None and config.nav.radio.receiver is None
        self._agreements: dict[tuple[str, str], _Agreement] = {}

    @property
    def is_useful(self) -> bool:
        """Whether there is any witness."""
        return bool(self._witnesses) or self.has_dme_fix

    def take(self, device: str, m: Measurement, admitted: Iterable[Measurement], t_ns: int) -> None:
        """Take a measurement: of a witness what tests of one source admit of it, of others before they refuse it."""
        source = self._sources.get(device)
        if source is None:
            return
        for each in admitted if device in self._witnesses else (m,):
            if isinstance(each, Position):
                source.push_position(each, t_ns)
            elif isinstance(each, Velocity):
                source.push_velocity(each, t_ns)

    def update(
        self,
        t_ns: int,
        sizes: Mapping[str, Size],
        attitude: AttitudeState | None,
        compared: FilterReference | None,
        fix: PositionState | None,
    ) -> list[Confirmation]:
        """Compare receivers whose contradiction stands with the witnesses.

        sizes : of contradictions by receiver;  compared : the filter;  fix : by DME alone, None where there is none
        """
        found = [
            self._compare(t_ns, (device, name), size, (self._at(device, t_ns, attitude), witness), compared)
            for device, size in sizes.items()
            if device in self._sources
            for name, witness in self._positions(device, t_ns, attitude, fix)
            if name not in sizes
        ]
        self._agreements = {key: agreement for key, agreement in self._agreements.items() if key[0] in sizes}
        return [confirmation for confirmation in found if confirmation]

    def _positions(
        self, device: str, t_ns: int, attitude: AttitudeState | None, fix: PositionState | None
    ) -> Iterator[tuple[str, PositionState | None]]:
        """Of all that share nothing with a receiver."""
        for name in self._witnesses:
            if self._depends[name].isdisjoint(self._depends[device]):
                yield name, self._at(name, t_ns, attitude)
        if self.has_dme_fix:
            yield "radio", fix

    def _at(self, name: str, t_ns: int, attitude: AttitudeState | None) -> PositionState | None:
        """A position with sigmas, the assumed ones where it states none."""
        found = self._sources[name].position(t_ns, attitude)
        if found is None:
            return None
        level, height = self._assumed.get(name, (None, None))
        return replace(found, horizontal_sd=found.horizontal_sd or level, vertical_sd=found.vertical_sd or height)

    def _compare(
        self,
        t_ns: int,
        names: tuple[str, str],
        size: Size,
        positions: tuple[PositionState | None, PositionState | None],
        compared: FilterReference | None,
    ) -> Confirmation | None:
        """names, positions : of receiver and witness"""
        here, witness = positions
        tolerance = find_tolerance(here, witness, size, self._limits) if here and witness else None
        if here is None or witness is None or tolerance is None:
            self._agreements.pop(names, None)
            return None
        is_beyond = _is_beyond(here, compared)
        if is_beyond != _is_beyond(witness, compared):
            self._agreements.pop(names, None)
            return None
        agreement = self._agreements.get(names)
        if agreement is None or agreement.is_against_filter != is_beyond:
            agreement = self._agreements[names] = _Agreement(t_ns, is_beyond)
        agreement.take(here.newest_ns)
        return Confirmation(*names, tolerance, is_beyond) if agreement.has_lasted(t_ns) else None


def find_tolerance(here: PositionState, witness: PositionState, size: Size, limits: AlertLimits) -> float | None:
    """How far a receiver may be wrong that a witness agrees with [m]; None: it does not agree, or proves too little."""
    level, height = differences(here, witness)
    found = _tolerance(level, (here.horizontal_sd, witness.horizontal_sd), K_RADIAL)
    if found is None or size.level is None or found >= min(0.5 * size.level, limits.position_m):
        return None
    if size.height is None:
        return found
    high = None if height is None else _tolerance(height, (here.vertical_sd, witness.vertical_sd), K_AXIS)
    if high is None or high >= min(0.5 * size.height, limits.altitude_m):
        return None
    return max(found, high)


def _tolerance(difference: float, sds: tuple[float | None, float | None], k: float) -> float | None:
    """What a difference leaves possible [m]; None: it is too large, or a sigma is unknown.  sds : receiver, witness"""
    sd, witness_sd = sds
    if not sd or not witness_sd or difference > k * math.hypot(sd, witness_sd):
        return None
    return difference + k * witness_sd


def _is_beyond(position: PositionState, compared: FilterReference | None) -> bool:
    """Whether a position contradicts the filter horizontally."""
    if compared is None:
        return False
    difference, _ = differences(position, compared.position)
    return difference > compared.horizontal + K_RADIAL * (position.horizontal_sd or 0.0)

"""Independent sources that can confirm a receiver with a lasting contradiction.

The dependences of a source are declared (``depends_on`` of its device); a source without a declaration confirms
nothing.  A fix from DME stations only has no shared dependence.  For CONFIRMATION_NS and CONFIRMATION_COUNT
consecutive fixes

    |z - w| <= K hypot(sigma_z, sigma_w)                    they agree
    |z - w| + K sigma_w < D / 2 and the alert limit         an error of the size of the contradiction would be detected

z, w : position of the receiver and of the source;  D : contradiction of the receiver;  K = 4.80, vertically 4.42.
If the filter refuses both, beyond its protection level and K sigma, the filter is wrong and restarts.

Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_confirmation.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from msgspec.structs import replace

from fti.config import AlertLimits, Config, position_sources
from fti.messages.measurements import Measurement, Position, Velocity
from fti.nav.protection import K_AXIS, K_RADIAL, FilterReference, differences
from fti.nav.source_interpolation import AttitudeState, NavSource, PositionState

CONFIRMATION_NS, CONFIRMATION_COUNT = 30_000_000_000, 30
#: Dependence of a receiver without declaration.
SATELLITES = frozenset({"satellites"})


class Size(NamedTuple):
    """Size of a lasting contradiction [m]: horizontally, and in height; None: no contradiction."""

    horizontal: float | None
    height: float | None = None


class Confirmation(NamedTuple):
    """An independent source agrees with a receiver.

    tolerance : possible remaining error of the receiver [m]
    is_against_filter : both contradict the filter
    """

    device: str
    source: str
    tolerance: float
    is_against_filter: bool


@dataclass(slots=True)
class _Agreement:
    """Of a receiver and a source.  since_ns, fixes : start and number of consecutive fixes;  newest_ns : last fix"""

    since_ns: int
    is_against_filter: bool
    fixes: int = 0
    newest_ns: int = 0

    def count(self, newest_ns: int) -> None:
        """Count each fix once."""
        self.fixes += newest_ns != self.newest_ns
        self.newest_ns = newest_ns

    def has_lasted(self, t_ns: int) -> bool:
        """Whether it has lasted for CONFIRMATION_NS and CONFIRMATION_COUNT fixes."""
        return t_ns - self.since_ns >= CONFIRMATION_NS and self.fixes >= CONFIRMATION_COUNT


class ConfirmationMonitor:
    """The independent sources of a configuration.  assumed : sigmas of positions that state none, by device [m]

    has_dme_fix : whether positions from DME only can confirm a receiver, too
    is_useful : whether any source can confirm a receiver
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
        self._independent = tuple(name for name in devices if name in declared)
        self._sources = {name: NavSource(device) for name, device in devices.items()}
        self.has_dme_fix = config.nav.radio is not None and config.nav.radio.receiver is None
        self.is_useful = bool(self._independent) or self.has_dme_fix
        self._agreements: dict[tuple[str, str], _Agreement] = {}

    def feed(self, device: str, m: Measurement, admitted: Iterable[Measurement], t_ns: int) -> None:
        """Take a measurement: of an independent source the parts that its own tests admit, of others all parts."""
        source = self._sources.get(device)
        if source is None:
            return
        for each in admitted if device in self._independent else (m,):
            if isinstance(each, Position):
                source.push_position(each, t_ns)
            elif isinstance(each, Velocity):
                source.push_velocity(each, t_ns)

    def update(
        self,
        t_ns: int,
        sizes: Mapping[str, Size],
        attitude: AttitudeState | None,
        reference: FilterReference | None,
        fix: PositionState | None,
    ) -> list[Confirmation]:
        """Compare receivers with lasting contradictions with the independent sources.

        sizes : of contradictions by receiver;  reference : the filter;  fix : from DME only, or None
        """
        confirmations = [
            self._compare(t_ns, (device, name), size, (self._at(device, t_ns, attitude), confirming), reference)
            for device, size in sizes.items()
            if device in self._sources
            for name, confirming in self._positions(device, t_ns, attitude, fix)
            if name not in sizes
        ]
        self._agreements = {key: agreement for key, agreement in self._agreements.items() if key[0] in sizes}
        return [confirmation for confirmation in confirmations if confirmation]

    def _positions(
        self, device: str, t_ns: int, attitude: AttitudeState | None, fix: PositionState | None
    ) -> Iterator[tuple[str, PositionState | None]]:
        """Positions of all sources without shared dependences with a receiver."""
        for name in self._independent:
            if self._depends[name].isdisjoint(self._depends[device]):
                yield name, self._at(name, t_ns, attitude)
        if self.has_dme_fix:
            yield "radio", fix

    def _at(self, name: str, t_ns: int, attitude: AttitudeState | None) -> PositionState | None:
        """A position with sigmas, the assumed ones if it states none."""
        position = self._sources[name].position(t_ns, attitude)
        if position is None:
            return None
        sd_h, sd_v = self._assumed.get(name, (None, None))
        return replace(position, horizontal_sd=position.horizontal_sd or sd_h, vertical_sd=position.vertical_sd or sd_v)

    def _compare(
        self,
        t_ns: int,
        names: tuple[str, str],
        size: Size,
        positions: tuple[PositionState | None, PositionState | None],
        reference: FilterReference | None,
    ) -> Confirmation | None:
        """names, positions : of receiver and source"""
        position, other = positions
        tolerance = find_tolerance(position, other, size, self._limits) if position and other else None
        if position is None or other is None or tolerance is None:
            self._agreements.pop(names, None)
            return None
        is_beyond = _is_beyond(position, reference)
        if is_beyond != _is_beyond(other, reference):
            self._agreements.pop(names, None)
            return None
        agreement = self._agreements.get(names)
        if agreement is None or agreement.is_against_filter != is_beyond:
            agreement = self._agreements[names] = _Agreement(t_ns, is_beyond)
        agreement.count(position.newest_ns)
        return Confirmation(*names, tolerance, is_beyond) if agreement.has_lasted(t_ns) else None


def find_tolerance(position: PositionState, other: PositionState, size: Size, limits: AlertLimits) -> float | None:
    """Possible error of a receiver that another position confirms [m]; None: no agreement, or sigmas too large."""
    horizontal, height = differences(position, other)
    tolerance = _tolerance(horizontal, (position.horizontal_sd, other.horizontal_sd), K_RADIAL)
    if tolerance is None or size.horizontal is None or tolerance >= min(0.5 * size.horizontal, limits.position_m):
        return None
    if size.height is None:
        return tolerance
    vertical = None if height is None else _tolerance(height, (position.vertical_sd, other.vertical_sd), K_AXIS)
    if vertical is None or vertical >= min(0.5 * size.height, limits.altitude_m):
        return None
    return max(tolerance, vertical)


def _tolerance(difference: float, sds: tuple[float | None, float | None], k: float) -> float | None:
    """Possible error for a difference [m]; None: it is too large, or a sigma is unknown.  sds : receiver, source"""
    sd, source_sd = sds
    if not sd or not source_sd or difference > k * math.hypot(sd, source_sd):
        return None
    return difference + k * source_sd


def _is_beyond(position: PositionState, reference: FilterReference | None) -> bool:
    """Whether a position contradicts the filter horizontally."""
    if reference is None:
        return False
    difference, _ = differences(position, reference.position)
    return difference > reference.horizontal + K_RADIAL * (position.horizontal_sd or 0.0)

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

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fti.config import AlertLimits, Config, position_sources
from fti.nav.protection import K_AXIS, K_RADIAL, Compared, differences
from fti.nav.sources import AttitudeState, PositionState, Source
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
        self._sources = {name: Source(device) for name, device in devices.items()}
        self.is_fixed = config.nav.radio is not None and config.nav.radio.receiver is None
        self._agreements: dict[tuple[str, str], _Agreement] = {}

    @property
    def is_useful(self) -> bool:
        """Whether there is any witness."""
        return bool(self._witnesses) or self.is_fixed

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
        compared: Compared | None,
        fix: PositionState | None,
    ) -> list[Confirmation]:
        """Compare receivers whose contradiction stands with the witnesses.

        sizes : of contradictions by receiver;  compared : the filter;  fix : by DME alone, None where there is none
        """
        found = [
            confirmation
            for device, size in sizes.items()
            if device in self._sources
            for name, witness in self._positions(device, sizes, t_ns, attitude, fix)
            if (confirmation := self._compare(t_ns, device, name, size, witness, attitude, compared))
        ]
        self._agreements = {key: agreement for key, agreement in self._agreements.items() if key[0] in sizes}
        return found

    def _positions(
        self,
        device: str,
        sizes: Mapping[str, Size],
        t_ns: int,
        attitude: AttitudeState | None,
        fix: PositionState | None,
    ) -> Iterator[tuple[str, PositionState | None]]:
        for name in self._witnesses:
            if name not in sizes and self._depends[name].isdisjoint(self._depends[device]):
                yield name, self._sources[name].position(t_ns, attitude)
        if self.is_fixed:
            yield "radio", fix

    def _compare(
        self,
        t_ns: int,
        device: str,
        name: str,
        size: Size,
        witness: PositionState | None,
        attitude: AttitudeState | None,
        compared: Compared | None,
    ) -> Confirmation | None:
        here, key = self._sources[device].position(t_ns, attitude), (device, name)
        tolerance = None
        if here is not None and witness is not None:
            tolerance = find_tolerance(
                here, self._sd(device, here), witness, self._sd(name, witness), size, self._limits
            )
        if here is None or witness is None or tolerance is None:
            self._agreements.pop(key, None)
            return None
        beyond = [_is_beyond(p, self._sd(whose, p), compared) for whose, p in ((device, here), (name, witness))]
        if beyond[0] != beyond[1]:
            self._agreements.pop(key, None)
            return None
        agreement = self._agreements.get(key)
        if agreement is None or agreement.is_against_filter != beyond[0]:
            agreement = self._agreements[key] = _Agreement(t_ns, beyond[0])
        agreement.take(here.newest_ns)
        return Confirmation(device, name, tolerance, beyond[0]) if agreement.has_lasted(t_ns) else None

    def _sd(self, name: str, position: PositionState) -> tuple[float, float]:
        level, height = self._assumed.get(name, (0.0, 0.0))
        return position.horizontal_sd or level, position.vertical_sd or height


def find_tolerance(
    here: PositionState,
    sd: tuple[float, float],
    witness: PositionState,
    witness_sd: tuple[float, float],
    size: Size,
    limits: AlertLimits,
) -> float | None:
    """How far a receiver may be wrong that a witness agrees with [m]; None: it does not agree, or proves too little.

    sd, witness_sd : horizontal and vertical [m]
    """
    level, height = differences(here, witness)
    rows = [(size.level, level, K_RADIAL, sd[0], witness_sd[0], limits.position_m)]
    if size.height is not None:
        rows.append((size.height, height, K_AXIS, sd[1], witness_sd[1], limits.altitude_m))
    tolerances = [_tolerance(*row) for row in rows]
    return None if None in tolerances else max(t for t in tolerances if t is not None)


def _tolerance(
    size: float | None, apart: float | None, k: float, sd: float, witness_sd: float, limit: float
) -> float | None:
    if size is None or apart is None or witness_sd <= 0.0 or apart > k * (sd**2 + witness_sd**2) ** 0.5:
        return None
    found = apart + k * witness_sd
    return found if found < min(0.5 * size, limit) else None


def _is_beyond(position: PositionState, sd: tuple[float, float], compared: Compared | None) -> bool:
    """Whether a position contradicts the filter horizontally."""
    if compared is None:
        return False
    return differences(position, compared.position)[0] > compared.horizontal + K_RADIAL * sd[0]

"""Satellites of an NMEA 0183 receiver: in view (GSV, per system and signal) and in use (GSA)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from msgspec.structs import replace

from fti.formats import nmea_fields as fields
from fti.messages.measurements import Satellite, Satellites, Stamp

TALKERS = {
    "GP": "gps", "GL": "glonass", "GA": "galileo", "GB": "beidou", "BD": "beidou", "GQ": "qzss", "QZ": "qzss",
    "GI": "navic",
}  # fmt: skip
#: NMEA 0183 4.11, table of GNSS identifiers.
SYSTEM_IDS = {"1": "gps", "2": "glonass", "3": "galileo", "4": "beidou", "5": "qzss", "6": "navic"}
#: Numbers without a system, or with GPS: first, last, system, offset to the number within the system.
NUMBERS = (
    (1, 32, "gps", 0), (33, 64, "sbas", 87), (65, 99, "glonass", -64), (120, 158, "sbas", 0), (173, 182, "imes", -172),
    (193, 200, "qzss", -192), (201, 263, "beidou", -200), (301, 336, "galileo", -300), (401, 463, "beidou", -400),
)  # fmt: skip
#: Offsets for receivers that use those numbers although they name the system.
OFFSETS = {
    "glonass": ((65, 99, -64),),
    "galileo": ((101, 136, -100), (301, 336, -300)),
    "beidou": ((201, 263, -200), (401, 463, -400)),
    "qzss": ((193, 202, -192),),
}  # fmt: skip
ANY = ""

SatelliteKey = tuple[str, int]  # system, number within it


def identify(system: str | None, number: int) -> SatelliteKey:
    """System and number within it.  system : from the sentence; with "gps" the number decides."""
    if system is None or system == "gps":
        for low, high, name, offset in NUMBERS:
            if low <= number <= high:
                return name, number + offset
        return system or "unknown", number
    offset = next((o for low, high, o in OFFSETS.get(system, ()) if low <= number <= high), 0)
    return system, number + offset


class SentenceGroup(NamedTuple):
    """A group of GSV sentences: arrival of the first, talker and signal, number of sentences, satellites."""

    t_rx_ns: int
    key: str
    sentences: int
    satellites: tuple[Satellite, ...]


class SkyView:
    """Satellites over several sentences.

    The view of one signal of one system is kept until it is repeated, or until another one was repeated meanwhile: each
    list contains all systems, and no view is older than a cycle.
    """

    def __init__(self) -> None:
        self._run = 0  # number of the run of consecutive GSA sentences
        self._used: dict[str, tuple[int, frozenset[SatelliteKey]]] = {}
        self._in_use: frozenset[SatelliteKey] = frozenset()
        self._open: dict[str, SentenceGroup] = {}
        self._views: dict[str, dict[SatelliteKey, Satellite]] = {}
        self._updated: set[str] = set()

    def end_gsa_run(self) -> None:
        """A sentence other than GSA ends a run of GSA sentences."""
        self._run += 1

    def read_gsa(self, f: list[str]) -> tuple[Satellite, ...]:
        """GSA: satellites in use, of one system or of any."""
        stated = SYSTEM_IDS.get(f[18].lstrip("0")) if len(f) > 18 else TALKERS.get(f[0][:2])
        keys = [identify(stated, n) for text in f[3:15] if (n := fields.integer(text)) is not None]
        run, before = self._used.get(stated or ANY, (self._run, frozenset()))
        self._used[stated or ANY] = (self._run, frozenset(keys) | (before if run == self._run else frozenset()))
        self._in_use = frozenset[SatelliteKey]().union(*(used for _, used in self._used.values()))
        return tuple(Satellite(system=system, number=number, used=True) for system, number in keys)

    def read_gsv(self, f: list[str], t_rx_ns: int) -> Satellites | None:
        """GSV: all satellites in view, with the last sentence of a system or of one of its signals.

        PQGSV of Quectel has signal and system at its end.
        """
        count, index = int(f[1]), int(f[2])
        groups, rest = divmod(len(f) - 4, 4)
        if not 1 <= index <= count or (rest > 1 and not (f[0] == "PQGSV" and rest == 2)) or (rest and len(f[-1]) > 1):
            raise ValueError("fields are missing")
        group = self._open.pop(f[0], None)
        if index == 1:
            group = SentenceGroup(t_rx_ns, ",".join((f[0], *f[len(f) - rest :])), 0, ())
        if group is None or group.sentences != index - 1:
            return None  # a sentence of the group is lost
        stated = SYSTEM_IDS.get(f[-1]) if rest == 2 else TALKERS.get(f[0][:2])
        members = (self._satellite(stated, f[4 + 4 * i : 8 + 4 * i]) for i in range(groups))
        satellites = group.satellites + tuple(satellite for satellite in members if satellite)
        if index < count:
            self._open[f[0]] = SentenceGroup(group.t_rx_ns, group.key, index, satellites)
            return None
        self._keep(group.key, satellites)
        return Satellites(stamp=Stamp(group.t_rx_ns), satellites=self._all_satellites())

    def _satellite(self, stated: str | None, group: list[str]) -> Satellite | None:
        number = fields.integer(group[0])
        if number is None:
            return None
        key = identify(stated, number)
        elevation, azimuth, cn0 = map(fields.number, group[1:])
        if elevation is not None and not -90.0 <= elevation <= 90.0:
            elevation = azimuth = None
        return Satellite(
            system=key[0],
            number=key[1],
            azimuth=None if azimuth is None else math.radians(azimuth % 360.0),
            elevation=None if elevation is None else math.radians(elevation),
            cn0_dbhz=cn0 or None,
            used=self._is_used(key),
        )

    def _keep(self, key: str, satellites: tuple[Satellite, ...]) -> None:
        if key in self._updated:
            self._views = {k: v for k, v in self._views.items() if k in self._updated}
            self._updated = set()
        self._updated.add(key)
        self._views.pop(key, None)  # the newest comes last
        self._views[key] = _merge_satellites(satellites)

    def _all_satellites(self) -> tuple[Satellite, ...]:
        """Every satellite once: the newest direction, the strongest signal."""
        merged = _merge_satellites(satellite for view in self._views.values() for satellite in view.values())
        return tuple(
            satellite if satellite.used == (used := self._is_used(key)) else replace(satellite, used=used)
            for key, satellite in merged.items()
        )

    def _is_used(self, key: SatelliteKey) -> bool | None:
        """None without a GSA of its system."""
        if key in self._in_use:
            return True
        is_known = ANY in self._used or key[0] in self._used or (key[0] == "sbas" and "gps" in self._used)
        return False if is_known else None


def _merge_satellites(satellites: Iterable[Satellite]) -> dict[SatelliteKey, Satellite]:
    merged: dict[SatelliteKey, Satellite] = {}
    for newer in satellites:
        key = (newer.system, newer.number)
        older = merged.get(key)
        merged[key] = newer if older is None else _merge_signals(newer, older)
    return merged


def _merge_signals(newer: Satellite, older: Satellite) -> Satellite:
    cn0 = max(newer.cn0_dbhz or 0.0, older.cn0_dbhz or 0.0) or None
    if newer.elevation is None:
        return replace(newer, elevation=older.elevation, azimuth=older.azimuth, cn0_dbhz=cn0)
    return newer if cn0 == newer.cn0_dbhz else replace(newer, cn0_dbhz=cn0)

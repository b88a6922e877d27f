"""The sky that NMEA 0183 tells in pieces: satellites in view (GSV, per system and signal) and in use (GSA)."""

from __future__ import annotations

import math

from fti.drivers import _nmea_fields as fields
from fti.types import Satellite, Satellites, Stamp

TALKERS = {
    "GP": "gps", "GL": "glonass", "GA": "galileo", "GB": "beidou", "BD": "beidou", "GQ": "qzss", "QZ": "qzss",
    "PQ": "qzss", "GI": "navic",
}  # fmt: skip
#: NMEA 0183 4.11, table of GNSS identifiers.
SYSTEM_IDS = {"1": "gps", "2": "glonass", "3": "galileo", "4": "beidou", "5": "qzss", "6": "navic"}
#: Numbers without a system, or with GPS: first, last, system, what to add for the number within the system.
NUMBERS = (
    (1, 32, "gps", 0), (33, 64, "sbas", 87), (65, 99, "glonass", -64), (120, 158, "sbas", 0), (173, 182, "imes", -172),
    (193, 200, "qzss", -192), (201, 263, "beidou", -200), (301, 336, "galileo", -300), (401, 463, "beidou", -400),
)  # fmt: skip
#: The same for receivers that use those numbers although they name the system.
OFFSETS = {
    "glonass": ((65, 99, -64),), "galileo": ((301, 336, -300),), "beidou": ((201, 263, -200), (401, 463, -400)),
    "qzss": ((193, 202, -192),),
}  # fmt: skip
ANY = ""

Key = tuple[str, int]  # system, number within it


def identify(given: str | None, number: int) -> Key:
    """System and number within it.  given : what the sentence says; "gps" may be any by its number."""
    if given is None or given == "gps":
        for low, high, name, offset in NUMBERS:
            if low <= number <= high:
                return name, number + offset
        return given or "unknown", number
    offset = next((o for low, high, o in OFFSETS.get(given, ()) if low <= number <= high), 0)
    return given, number + offset


class Sky:
    """Satellites over several sentences.

    What one system says of one signal stays until it says it again, or until another has said it twice meanwhile: so
    each list has the whole sky, and nothing in it is older than a cycle.
    """

    def __init__(self) -> None:
        self._run = 0  # GSA sentences after one another belong together
        self._used: dict[str, tuple[int, frozenset[Key]]] = {}
        self._open: dict[str, tuple[int, int, tuple[Satellite, ...]]] = {}  # arrival, sentences so far, satellites
        self._views: dict[str, tuple[Satellite, ...]] = {}
        self._fresh: set[str] = set()

    def other(self) -> None:
        """A sentence that is no GSA."""
        self._run += 1

    def used(self, f: list[str]) -> tuple[Satellite, ...]:
        """GSA: satellites in use, of one system or of any."""
        given = SYSTEM_IDS.get(f[18].lstrip("0")) if len(f) > 18 else TALKERS.get(f[0][:2])
        keys = [identify(given, n) for text in f[3:15] if (n := fields.integer(text)) is not None]
        run, before = self._used.get(given or ANY, (self._run, frozenset()))
        self._used[given or ANY] = (self._run, frozenset(keys) | (before if run == self._run else frozenset()))
        return tuple(Satellite(system=system, number=number, used=True) for system, number in keys)

    def view(self, f: list[str], t_rx_ns: int) -> Satellites | None:
        """GSV: all satellites in view, with the last sentence of a system or of one of its signals."""
        count, index = int(f[1]), int(f[2])
        groups, rest = divmod(len(f) - 4, 4)
        if rest > 1 or not 1 <= index <= count:
            raise ValueError("fields are missing")
        key = f[0] + (f[-1] if rest else "")
        begun = self._open.pop(key, None)
        if index == 1:
            begun = (t_rx_ns, 0, ())
        if begun is None or begun[1] != index - 1:
            return None  # a sentence of the group is lost
        t_first, _, seen = begun
        given = TALKERS.get(f[0][:2])
        found = (_satellite(given, f[4 + 4 * i : 8 + 4 * i]) for i in range(groups))
        seen += tuple(satellite for satellite in found if satellite)
        if index < count:
            self._open[key] = (t_first, index, seen)
            return None
        self._keep(key, seen)
        return Satellites(stamp=Stamp(t_first), satellites=self._whole())

    def _keep(self, key: str, seen: tuple[Satellite, ...]) -> None:
        if key in self._fresh:
            self._views = {k: v for k, v in self._views.items() if k in self._fresh}
            self._fresh = set()
        self._fresh.add(key)
        self._views[key] = seen

    def _whole(self) -> tuple[Satellite, ...]:
        """Every satellite once, with the strongest of its signals."""
        best: dict[Key, Satellite] = {}
        for satellite in (s for view in self._views.values() for s in view):
            key = (satellite.system, satellite.number)
            if key not in best or (satellite.cn0_dbhz or 0.0) > (best[key].cn0_dbhz or 0.0):
                best[key] = satellite
        return tuple(self._marked(satellite) for satellite in best.values())

    def _marked(self, s: Satellite) -> Satellite:
        if s.system not in self._used and ANY not in self._used:
            return s
        used = any((s.system, s.number) in keys for _, keys in self._used.values())
        return Satellite(
            system=s.system, number=s.number, azimuth=s.azimuth, elevation=s.elevation, cn0_dbhz=s.cn0_dbhz, used=used
        )


def _satellite(given: str | None, group: list[str]) -> Satellite | None:
    number = fields.integer(group[0])
    if number is None:
        return None
    system, number = identify(given, number)
    elevation, azimuth, cn0 = (fields.number(text) for text in group[1:])
    if elevation is not None and not -90.0 <= elevation <= 90.0:
        elevation = azimuth = None
    return Satellite(
        system=system,
        number=number,
        azimuth=None if azimuth is None else math.radians(azimuth % 360.0),
        elevation=None if elevation is None else math.radians(elevation),
        cn0_dbhz=cn0 or None,
    )

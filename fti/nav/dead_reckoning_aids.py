"""Selection, period and sigma of the airspeeds and magnetic fields that aid the filter.

Gusts are correlated for L / V; a sample every T has the variance sigma^2 2 L / (V T), like a velocity of a receiver.
So an airspeed every 5 s contains as much information as ten a second, and a wrong one is detected more easily.
"""

from __future__ import annotations

import math

from fti.config import Filter
from fti.constants import SECOND_NS
from fti.messages.measurements import Airspeed, MagneticField, Measurement
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.dead_reckoning import MagneticHeading, TrueAirspeed

#: Period of aiding by each of them [ns].
AIRSPEED_NS, HEADING_NS = 5 * SECOND_NS, SECOND_NS
#: Minimum airspeed: its impact pressure, 138 Pa, is little more than errors of the static port [m/s].
MIN_TAS = 15.0
#: Sigma of an airspeed without gusts [m/s], and of the levelled heading without its slow error [rad]: assumed.
TAS_SD, HEADING_SD = 1.0, math.radians(1.0)
#: Gusts: sigma [m/s] and length [m] of light turbulence above 2000 ft, 5 ft/s and 1750 ft (MIL-F-8785C, 3.7.2).
GUST_SD, GUST_LENGTH = 1.5, 533.0
#: Plausible field: that of the Earth is 22 to 67 uT (IGRF-13) [T].
MIN_FIELD, MAX_FIELD = 20e-6, 75e-6


def airspeed_name(device: str) -> str:
    """Name of airspeeds of a device in the gate."""
    return f"{device}.airspeed"


def heading_name(device: str) -> str:
    """Name of magnetic headings of a device in the gate."""
    return f"{device}.heading"


def dead_reckoning_names(settings: Filter) -> frozenset[str]:
    """Names of all aids that are used without satellites and have no position."""
    airspeed = () if settings.airspeed is None else (airspeed_name(settings.airspeed),)
    heading = () if settings.heading is None else (heading_name(settings.heading),)
    return frozenset((*airspeed, *heading))


class DeadReckoningAids:
    """Dead-reckoning aids of one filter.  settings : its aiding sources"""

    def __init__(self, settings: Filter) -> None:
        self._settings = settings
        self._last_ns: dict[str, int] = {}

    def make(self, device: str, m: Measurement, t_ns: int) -> Aiding | None:
        """The aiding of a measurement that is valid at t_ns; None if it does not aid."""
        if isinstance(m, Airspeed) and device == self._settings.airspeed:
            return self._airspeed(device, m, t_ns)
        if isinstance(m, MagneticField) and device == self._settings.heading:
            return self._heading(device, m, t_ns)
        return None

    def _airspeed(self, device: str, m: Airspeed, t_ns: int) -> Aiding | None:
        name = airspeed_name(device)
        if not m.valid or m.tas is None or not m.tas >= MIN_TAS or not self._is_due(name, t_ns, AIRSPEED_NS):
            return None
        gusts = GUST_SD * math.sqrt(max(1.0, 2.0 * GUST_LENGTH / m.tas * SECOND_NS / AIRSPEED_NS))
        return TrueAirspeed(m.tas, math.hypot(TAS_SD, gusts), gusts, name)

    def _heading(self, device: str, m: MagneticField, t_ns: int) -> Aiding | None:
        name, field = heading_name(device), math.hypot(*m.field_b)
        if not m.valid or not MIN_FIELD <= field <= MAX_FIELD or not self._is_due(name, t_ns, HEADING_NS):
            return None
        declination = math.radians(self._settings.declination_deg or 0.0)
        return MagneticHeading(m.field_b, declination, HEADING_SD, name)

    def _is_due(self, name: str, t_ns: int, period_ns: int) -> bool:
        """Whether the last one is at least a period ago; then this one becomes the last."""
        last_ns = self._last_ns.get(name)
        if last_ns is not None and abs(t_ns - last_ns) < period_ns:
            return False
        self._last_ns[name] = t_ns
        return True

"""Default tables of the emulated nodes: a straight line over the travel of each surface.

Travels are an example of a light twin; raw counts are those of a 12-bit converter with some margin.
"""

from __future__ import annotations

from collections.abc import Iterable

from fti.drivers.deflection_pickups.table import CalibrationTable

#: From the lowest to the highest raw count, and the travel between them [deg].
RAW = (256, 3840)
TRAVEL_DEG = {
    "elevator": (-16.0, 14.0),
    "rudder": (-28.0, 28.0),
    "rudder_trim": (-12.0, 12.0),
    "left_aileron": (-26.0, 16.0),
    "right_aileron": (-26.0, 16.0),
    "flaps": (-1.0, 43.0),
    "stick_aileron": (-22.0, 22.0),
    "stick_elevator": (-18.0, 18.0),
    "pedals": (-20.0, 20.0),
    "elevator_trim": (-10.0, 10.0),
}
ANY_DEG = (-30.0, 30.0)


def factory_tables(surfaces: Iterable[str]) -> dict[str, CalibrationTable]:
    """A table for each surface; an unknown one gets a travel of +-30 degrees."""
    return {
        surface: CalibrationTable(((RAW[0], round(100.0 * low)), (RAW[1], round(100.0 * high))))
        for surface in surfaces
        for low, high in [TRAVEL_DEG.get(surface, ANY_DEG)]
    }

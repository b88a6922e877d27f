"""Undulation of the geoid EGM96, for protocols whose altitude is above mean sea level."""

from __future__ import annotations

from fti.errors import MissingError
from fti.geodesy import coarse_geoid
from fti.geodesy.geoid import Geoid, load_geoid


class MeanSeaLevel:
    """Undulations from the grid of the system; without one, from the coarse grid of the package (0.13 m RMS)."""

    def __init__(self) -> None:
        self._geoid: Geoid | None = None
        try:
            self._geoid = load_geoid("egm96")
        except MissingError:  # Debian: proj-data
            self._geoid = None

    def undulation(self, lat: float, lon: float) -> float:
        """Height of mean sea level above the WGS84 ellipsoid [m] at lat, lon [rad]."""
        if self._geoid is not None:
            return float(self._geoid.undulation(lat, lon))
        return coarse_geoid.undulation(lat, lon)

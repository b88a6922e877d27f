"""The position with which fixes are compared: ground truth of the emulator, or a filter with satellites."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from fti.arrays import Array
from fti.config import Device, Filter
from fti.messages.measurements import Measurement
from fti.nav.fallbacks import FILTER_TICKS
from fti.nav.inertial_aiding import AidedNavigation
from fti.post.score.truth_table import TruthTable


class ReferencePosition(NamedTuple):
    """lat, lon [rad];  cov : of its error north and east, shape (2, 2) [m^2]"""

    lat: float
    lon: float
    cov: Array


class Reference(Protocol):
    """A source of reference positions.  name : in a report"""

    name: str

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """A measurement that is valid at t_ns."""

    def tick(self, t_ns: int) -> None:
        """A tick of 20 ms."""

    def at(self, t_ns: int) -> ReferencePosition | None:
        """The position at a time of the last second; None where it is not known."""


class TruthReference:
    """The ground truth of one or more flights of the emulator."""

    def __init__(self, tables: list[TruthTable]) -> None:
        self.name, self._tables = "ground truth of the emulator", tables

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """Nothing."""

    def tick(self, t_ns: int) -> None:
        """Nothing."""

    def at(self, t_ns: int) -> ReferencePosition | None:
        """Exact; None outside of the flights."""
        for table in self._tables:
            if table.t_ns[0] <= t_ns <= table.t_ns[-1]:
                lat, lon = (float(table.at(name, np.array([t_ns]))[0]) for name in ("lat", "lon"))
                return ReferencePosition(lat, lon, np.zeros((2, 2)))
        return None


class SatelliteReference:
    """A filter with satellites and without the ground, while it accepts their positions.

    Its faulty receivers are excluded as in flight.  settings, devices : of the flight
    """

    def __init__(self, settings: Filter, devices: Mapping[str, Device]) -> None:
        self.name = f"filter with satellites ({', '.join(settings.gnss)}), while they are received"
        self._aided, self._ticks = AidedNavigation(settings, dict(devices)), 0

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """A measurement of a device of the filter."""
        if self._aided.accepts(device, type(m)):
            self._aided.feed(device, m, t_ns)

    def tick(self, t_ns: int) -> None:
        """Run the tests between the sources."""
        self._ticks += 1
        if self._ticks % FILTER_TICKS == 0:
            self._aided.events(t_ns)

    def at(self, t_ns: int) -> ReferencePosition | None:
        """With the covariance of the filter; None without satellites."""
        estimate = self._aided.estimate(t_ns) if self._aided.has_satellites(t_ns) else None
        if estimate is None:
            return None
        lat, lon, _ = estimate.geodetic
        return ReferencePosition(lat, lon, np.asarray(estimate.cov_n[:2, :2]))

"""Inputs of the oracle: the roles of the devices in a configuration, and the ground truth of the flight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from fti.arrays import Array, Mask
from fti.config import Altimeter, Config, Device
from fti.devices import BoundDevice
from fti.hil.faults.fault_targets import sends_time
from fti.hil.faults.gnss import RECEIVER_DRIVERS
from fti.hil.power import SUPPLY_V
from fti.hil.scenario import Scenario
from fti.hil.tables.fault_base import LinkFault
from fti.hil.tables.fault_types import CanStatus
from fti.hil.tables.schema import SensorSettings
from fti.terrain.demo_region import EDGE_M, edge_distance

#: Drivers whose protocol cannot declare a measurement, or the device, invalid.
DRIVERS_WITHOUT_VALIDITY: frozenset[str] = frozenset(
    {"honeywell_hmr2300", "dbc", "ascii_line", "binary_struct", "canaerospace", "velodyne_vlp16"}
)


@dataclass(frozen=True, slots=True)
class TruthSeries:
    """The ground truth of a flight, each shape (n,).

    t : time of the flight [s]; height_agl : [m]; before_threshold : along the track [m]; offset : right of it [m]
    roll, pitch : [rad]; climb : [m/s]
    ranges : by altimeter: range of its beam, minimum and maximum range within the position uncertainty [m]
    """

    t: Array
    height_agl: Array
    before_threshold: Array
    offset: Array
    roll: Array
    pitch: Array
    climb: Array
    ranges: Mapping[str, tuple[Array, Array, Array]] = field(default_factory=dict, kw_only=True)

    @property
    def end_s(self) -> float:
        """End of the flight [s]."""
        return float(self.t[-1])

    def span(self, where: Mask) -> tuple[float, float] | None:
        """First and last time at which the mask is set [s]; None if it never is."""
        at = np.flatnonzero(where)
        return (float(self.t[at[0]]), float(self.t[at[-1]])) if len(at) else None


class AircraftRoles:
    """The devices of a configuration in one scenario, and their roles.

    altimeters, sources, positions : names of the devices that have these roles
    filter_altimeters, filter_gnss : altimeters and receivers that aid the filter
    filter_imu, radio_stations     : for fallbacks: inertial unit of the filter, number of DME stations
    scan_drift                     : devices of the looks at the ground
    scene                          : built-in terrain of navigation; None: files, or no terrain
    """

    #: Time from the return of the signals to the fix of a receiver [s].
    FIX_S: ClassVar[float] = 3.0

    def __init__(self, config: Config, devices: Sequence[BoundDevice], scenario: Scenario) -> None:
        self._config, self._settings = config, scenario.sensor
        self.devices = devices
        self._bound = {bound.device.name: bound for bound in devices}
        self.power_units = [bound.device.name for bound in devices if bound.device.driver == "power_unit"]
        nav = config.nav
        self.altimeters = nav.altimeters
        self.has_terrain = nav.terrain is not None
        self.sources = frozenset((*nav.position, *nav.attitude))
        self.positions = nav.position
        self.filter_altimeters = nav.filter.altimeters if nav.filter else []
        self.filter_gnss = nav.filter.gnss if nav.filter else ()
        self.filter_imu = nav.filter.imu if nav.filter else None
        self.scan_drift = nav.scan_drift.devices if nav.filter and nav.scan_drift else ()
        self.radio_stations = len(nav.radio.station) if nav.radio else 0
        self.scene = nav.terrain.scene if nav.terrain else None
        self.approach = approach = nav.approach
        self.has_approach = approach is not None and bool(nav.altimeters)
        self.window_m = approach.window_m if approach else 0.0
        self.track_limit_m = approach.y_max_m if approach else math.inf

    def _device(self, name: str) -> Device:
        return self._bound[name].device

    # ---------------------------------------------------------------------------------------------------- one device

    def is_alone(self, name: str) -> bool:
        """Is it the only device on its link?"""
        return len(self.devices_on_link(self.link_of(name))) == 1

    def link_of(self, name: str) -> str:
        """Its link."""
        return self._device(name).link

    def is_on_can(self, name: str) -> bool:
        """Is it on a CAN bus?"""
        return frozenset({"can"}) == self._bound[name].driver.CARRIERS

    def max_age_s(self, name: str) -> float:
        """Maximum age of its data in navigation [s]."""
        return self._device(name).max_age_ms / 1e3

    def period_s(self, name: str) -> float:
        """Its period [s]; 1 s without a rate_hz."""
        return 1.0 / (self._device(name).rate_hz or 1.0)

    def has_rate(self, name: str) -> bool:
        """Has it a rate_hz?"""
        return self._device(name).rate_hz is not None

    def boot_s(self, name: str) -> float:
        """Its boot time [s]."""
        return self._sensor_settings(name).boot_s

    def stops_at(self, name: str, supply_v: float) -> bool:
        """Does it stop at this voltage?  A power unit has its own supply."""
        return (
            self._device(name).driver != "power_unit"
            and min(supply_v, SUPPLY_V) < self._sensor_settings(name).minimum_v
        )

    def _sensor_settings(self, name: str) -> SensorSettings:
        return self._settings.get(name, SensorSettings())

    def sends_time(self, name: str) -> bool:
        """Does it send its own time?"""
        bound = self._bound[name]
        return sends_time(bound.device.driver, bound.options)

    def can_declare_invalid(self, name: str) -> bool:
        """Can its protocol declare a measurement invalid?"""
        return self._device(name).driver not in DRIVERS_WITHOUT_VALIDITY

    def is_receiver(self, name: str) -> bool:
        """Is it a satellite receiver without other sources of position?"""
        return self._device(name).driver in RECEIVER_DRIVERS

    def is_laser(self, name: str) -> bool:
        """Is it a laser altimeter?"""
        altimeter = self._device(name).altimeter
        return altimeter is not None and altimeter.kind == "laser"

    def altimeter(self, name: str) -> Altimeter | None:
        """Its altimeter settings; None for other devices."""
        return self._device(name).altimeter

    def range_m(self, name: str) -> float:
        """Maximum range of an altimeter [m]; 0 for other devices."""
        altimeter = self._device(name).altimeter
        return altimeter.range_m[1] if altimeter else 0.0

    def preferred_roles(self, name: str) -> list[str]:
        """The roles for which it is the first in order of preference: position, attitude."""
        nav = self._config.nav
        return [
            role for role, names in (("position", nav.position), ("attitude", nav.attitude)) if names[:1] == (name,)
        ]

    # -------------------------------------------------------------------------------------------------------- others

    def devices_on_link(self, link: str) -> list[str]:
        """The devices on a link."""
        return [d.name for d in self._config.devices_on(link)]

    def can_links(self, fault: LinkFault) -> list[str]:
        """The CAN links of a fault that names none."""
        buses = [link for link in self._config.link if link.kind == "can"]
        return [link.name for link in buses if link.interface == "slcan" or not isinstance(fault, CanStatus)]

    def terrain_edge_mask(self, truth: TruthSeries) -> Mask:
        """Where a beam may reach the edge of the built-in terrain."""
        if not self.scene:
            return np.zeros(len(truth.t), dtype=bool)
        reach = self.beam_reach * truth.height_agl + EDGE_M
        return np.asarray(edge_distance(self.scene, truth.before_threshold, truth.offset) < reach)

    @property
    def beam_reach(self) -> float:
        """Horizontal reach of the widest beam of an altimeter, as a fraction of the height."""
        beams = [d.altimeter.beam_deg for name in self.altimeters if (d := self._device(name)).altimeter]
        return math.tan(math.radians(max(beams, default=0.0) / 2))

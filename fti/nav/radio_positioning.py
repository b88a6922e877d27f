"""Live position from satellites and DME; the devices are configured by ``[nav.radio]``."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fti.config import Device, Radio
from fti.messages.measurements import DmeRange, Measurement, Position, Satellites, Velocity
from fti.messages.outputs import HeightAboveGround, PositionFix
from fti.nav.altimetry.nadir_height import altitude_over_terrain
from fti.nav.altitude_hold import HoldMonitor
from fti.nav.navigation import NavState
from fti.nav.radio.observation_consistency import FIX
from fti.nav.radio.radio_navigator import HEIGHT, GeodeticPoint, RadioNavigator, RadioSettings, RadioState
from fti.nav.source_interpolation import PositionState, ellipsoidal_height, level_velocity
from fti.nav.terrain_reference import Ground


class RadioPosition:
    """Satellites of one receiver, DME ranges to known stations, and an altimeter over known ground.

    devices : by name.  Of the antenna's lever arm only the vertical part is used, as in level flight
    """

    def __init__(self, settings: Radio, devices: Mapping[str, Device]) -> None:
        self._settings = settings
        receiver = devices.get(settings.receiver or "")
        self._arm_down = receiver.lever_arm_b[2] if receiver else 0.0
        stations = {
            name: GeodeticPoint(math.radians(s.lat_deg), math.radians(s.lon_deg), s.alt_m)
            for name, s in settings.station.items()
        }
        self._radio = RadioNavigator(stations, RadioSettings(dme_sd=settings.dme_sd_m))
        self._hold = HoldMonitor()
        self._other_ns: int | None = None
        self._ground: Ground | None = None
        self._refused = frozenset[str]()

    def refuse(self, receivers: frozenset[str]) -> None:
        """Set the receivers that the filter excludes; their positions and velocities are not used."""
        self._refused = receivers

    def set_terrain(self, ground: Ground | None) -> None:
        """Set the ground; heights above it are used."""
        self._ground = ground

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of this kind of a device are used here."""
        return issubclass(kind, DmeRange) or (
            device == self._settings.receiver and issubclass(kind, (Satellites, Position, Velocity))
        )

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """Take a measurement that is valid at t_ns."""
        if isinstance(m, DmeRange) and m.valid:
            self._radio.feed_dme(t_ns, m.station, m.slant_range)
        if device != self._settings.receiver:
            return
        if isinstance(m, Satellites):
            self._feed_satellites(m, t_ns)
        elif device in self._refused:
            return
        elif isinstance(m, Position) and m.valid:
            self._feed_position(m, t_ns)
        elif isinstance(m, Velocity) and m.valid:
            north, east = level_velocity(m)
            if north is not None and east is not None:
                self._radio.feed_velocity(t_ns, north, east, m.down or 0.0)

    def _feed_satellites(self, m: Satellites, t_ns: int) -> None:
        """Messages without satellite directions are ignored: the last directions stay valid."""
        known = [s for s in m.satellites if s.used is not None and s.azimuth is not None and s.elevation is not None]
        if known:
            used = np.array([(s.azimuth, s.elevation) for s in known if s.used], dtype=np.float64).reshape(-1, 2)
            self._radio.feed_satellites(t_ns, used[:, 0], used[:, 1])

    def _feed_position(self, m: Position, t_ns: int) -> None:
        alt = ellipsoidal_height(m)
        if m.lat is not None and m.lon is not None and alt is not None:
            self._radio.feed_fix(
                t_ns, GeodeticPoint(m.lat, m.lon, alt + self._arm_down), m.horizontal_sd, m.vertical_sd
            )

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """A valid height of the configured altimeter, vertical if the ground is known."""
        if height.sensor != self._settings.altimeter or not height.valid or height.t_valid_ns is None:
            return
        if known := altitude_over_terrain(height, self._ground, nav.position):
            self._radio.feed_height(height.t_valid_ns, known.height_agl, known.height_sd, known.ground, known.ground_sd)

    @property
    def altitude_holders(self) -> tuple[str, ...]:
        """The altimeter, if it alone bounds the altitude of the fix."""
        return self._hold.altimeters

    def _update_hold(self, t_ns: int, state: RadioState) -> None:
        """Satellites bound the altitude; ranges to stations do only if the altimeter is not used."""
        used = set(state.used) - set(state.refused)
        if state.valid and (FIX in used or HEIGHT not in used):
            self._other_ns = t_ns
        altimeter = self._settings.altimeter if state.valid and HEIGHT in used else None
        self._hold.update(t_ns, self._other_ns, {altimeter: t_ns} if altimeter else {})

    def solution(self, t_ns: int) -> PositionFix:
        """The fix at t_ns."""
        state = self._radio.at(t_ns)
        self._update_hold(t_ns, state)
        return PositionFix(
            t_ns=t_ns,
            t_valid_ns=t_ns if state.lat is not None else None,
            valid=state.valid,
            reasons=state.reasons,
            lat=state.lat,
            lon=state.lon,
            alt=state.alt,
            horizontal_sd=state.horizontal_sd,
            vertical_sd=state.vertical_sd,
            altitude_source=state.source.value if state.source else None,
        )

    def position(self, t_ns: int) -> PositionState | None:
        """The position at t_ns; None if it is not valid."""
        state = self._radio.at(t_ns)
        if not state.valid or state.lat is None or state.lon is None:
            return None
        sds = state.horizontal_sd, state.vertical_sd
        return PositionState(state.lat, state.lon, state.alt, *sds, None, None, None, t_ns)

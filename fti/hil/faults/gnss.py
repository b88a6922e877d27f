"""Faults of satellite navigation, evaluated at the sample times of a receiver.

The receiver model applies them, because all its fields must agree: without a signal every field is invalid, and with a
spoofed signal position and velocity move consistently.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fti.arrays import Array, Mask
from fti.hil.tables.fault_types import Fault, GnssDegraded, GnssOffset, GnssOutage, GnssRamp

#: Drivers of receivers, and of devices that may contain one.
RECEIVER_DRIVERS = frozenset({"mavlink", "nmea0183", "novatel_oem6", "ublox_ubx"})
DRIVERS_WITH_RECEIVER = frozenset({"arinc429", "ascii_line", "binary_struct", "dbc", "imar_ixcom"}) | RECEIVER_DRIVERS
GnssFault = GnssOutage | GnssDegraded | GnssOffset | GnssRamp


class GnssFaults:
    """The faults of the receiver of one device."""

    def __init__(self, device: str, faults: Sequence[Fault]) -> None:
        self._faults = [f for f in faults if isinstance(f, GnssFault) and f.includes_device(device)]

    def jamming_mask(self, t: Array, after_s: float = 0.0) -> Mask:
        """Where no signal is received, or where it returned less than after_s ago [s]; t : shape (n,) [s]."""
        mask = np.zeros(t.shape, dtype=bool)
        for fault in self._faults:
            if isinstance(fault, GnssOutage):
                mask |= (t >= fault.from_s) & (t < fault.to_s + after_s)
        return mask

    def degraded_sds(self, t: Array) -> Array:
        """Standard deviation of each horizontal axis and of the height [m], shape (n, 2); NaN without a fault."""
        found = np.full((*t.shape, 2), np.nan)
        for fault in self._faults:
            if isinstance(fault, GnssDegraded):
                found[(t >= fault.from_s) & (t < fault.to_s)] = fault.horizontal_m, fault.vertical_m
        return found

    def offset_n(self, t: Array) -> tuple[Array, Array]:
        """Position error of the spoofed solution [m] and its rate [m/s]: north, east, down, shape (n, 3).

        An offset grows linearly in ``over_s`` and stays until the end of the interval; a ramp grows until then, and the
        velocity contains its rate only if ``with_velocity`` is set.
        """
        offset, rate = np.zeros((*t.shape, 3)), np.zeros((*t.shape, 3))
        for fault in self._faults:
            if isinstance(fault, GnssOffset):
                goal = np.array([fault.north_m, fault.east_m, -fault.up_m])
                here, since = (t >= fault.from_s) & (t < fault.to_s), t - fault.from_s
                offset[here] += _share(since, fault.over_s)[here, None] * goal
                moving = here & (since < fault.over_s)
                rate[moving] += goal / max(fault.over_s, 1e-9)
            elif isinstance(fault, GnssRamp):
                rate_n = np.array([fault.north_mps, fault.east_mps, -fault.up_mps])
                here, since = (t >= fault.from_s) & (t < fault.to_s), t - fault.from_s
                seconds, share = _ramp(since[here], float(np.linalg.norm(rate_n)), fault.onset_mps2)
                offset[here] += seconds[:, None] * rate_n
                rate[here] += share[:, None] * rate_n if fault.with_velocity else 0.0
        return offset, rate


def _ramp(since: Array, speed: float, onset: float) -> tuple[Array, Array]:
    """Equivalent time at full speed [s], and the share of the full speed; shape as since [s].

    From rest with ``onset`` [m/s^2] until ``speed`` [m/s] is reached; 0: at once.
    """
    if onset == 0.0:
        return since, np.ones_like(since)
    full_s = speed / onset
    return np.where(since < full_s, since**2 / (2.0 * full_s), since - full_s / 2.0), np.minimum(since / full_s, 1.0)


def _share(since: Array, over_s: float) -> Array:
    """0 to 1 in over_s; a step if it is 0."""
    return np.clip(since / over_s, 0.0, 1.0) if over_s > 0.0 else (since >= 0.0).astype(float)

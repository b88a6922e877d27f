"""The emulated scanner: data packets of scans that have the points of whole packets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.drivers.velodyne_vlp16.device_clock import HOUR_NS
from fti.drivers.velodyne_vlp16.options import Options
from fti.drivers.velodyne_vlp16.packets import (
    CHANNELS,
    DATA,
    DISTANCE_LSB_M,
    FLAG,
    POINTS,
    TURN,
    VLP16,
    ReturnMode,
)
from fti.messages.measurements import Measurement, RangeScan
from fti.ranging.scan_points import Floats, scan_points

MAX_DISTANCE = 2**16 - 1


class Encoder:
    """A packet for each scan; a scan with another number of points than a packet is not sent."""

    def __init__(self, options: Options) -> None:
        self._mode = ReturnMode[options.return_mode.upper()]

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not isinstance(measurement, RangeScan) or measurement.points != POINTS:
            return []
        points = scan_points(measurement)
        packet = np.zeros((), DATA)
        blocks = packet["blocks"]
        blocks["flag"] = int.from_bytes(FLAG, "little")
        blocks["azimuth"] = azimuths(points.directions_s[::CHANNELS])
        shape = blocks["channels"].shape
        is_lost = np.isnan(points.ranges) if measurement.valid else np.ones(POINTS, np.bool_)
        distances = np.clip(np.rint(points.ranges / DISTANCE_LSB_M), 0, MAX_DISTANCE)
        blocks["channels"]["distance"] = np.where(is_lost, 0.0, distances).reshape(shape)
        if points.intensities is not None:
            blocks["channels"]["reflectivity"] = points.intensities.reshape(shape)
        stamp = measurement.stamp
        time_ns = stamp.t_rx_ns if stamp.t_dev_ns is None else stamp.t_dev_ns
        packet["time_us"], packet["mode"], packet["product"] = time_ns % HOUR_NS // 1000, self._mode, VLP16
        return [packet.tobytes()]

    def respond(self, data: bytes) -> list[bytes]:
        return []


def azimuths(directions_s: Floats) -> NDArray[np.int64]:
    """Azimuths [deg / 100] of directions, shape (n, 3)."""
    angles = np.arctan2(directions_s[:, 0], directions_s[:, 1])
    return np.asarray(np.rint(angles * (TURN / (2.0 * np.pi))).astype(np.int64) % TURN)

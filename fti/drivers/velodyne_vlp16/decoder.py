"""Decoder of data and position packets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.drivers._framing import FramedDecoder
from fti.drivers.velodyne_vlp16.device_clock import DeviceClock, read_sentence
from fti.drivers.velodyne_vlp16.packets import (
    BLOCK_S,
    CHANNEL_S,
    DATA,
    DATA_BYTES,
    DISTANCE_LSB_M,
    LASERS,
    OFFSETS_S,
    PPS_AT,
    SENTENCE_AT,
    TIME_AT,
    TURN,
    VERTICAL,
    ReturnMode,
    measure,
)
from fti.messages.measurements import DeviceStatus, DeviceTime, Measurement, RangeScan, Stamp, TimeScale
from fti.ranging.scan_points import Floats, make_scan, point_arrays

PPS_LOCKED = 2
PPS_FLAGS = ("pps_absent", "pps_synchronising", "", "pps_error")
_LSB_RAD = np.float32(2.0 * np.pi / TURN)
#: Way of each channel between two blocks, cosine and sine of the vertical angle of each channel, shape (CHANNELS,).
_SHARE = (CHANNEL_S / BLOCK_S).astype(np.float32)
_COS, _SIN = (np.tile(f(VERTICAL).astype(np.float32), len(_SHARE) // LASERS) for f in (np.cos, np.sin))


class Decoder(FramedDecoder):
    """Packets to RangeScan, DeviceStatus and DeviceTime."""

    def __init__(self) -> None:
        super().__init__(measure, DATA_BYTES + 1)
        self._clock = DeviceClock()

    def copy_state(self, previous: Decoder) -> None:
        """Continue with the hour of the clock."""
        self._clock = previous._clock

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        if len(frame) == DATA_BYTES:
            return "data", [self._range_scan(frame, t_rx_ns)]
        return "position", self._position(frame, t_rx_ns)

    def _range_scan(self, frame: bytes, t_rx_ns: int) -> RangeScan:
        packet = np.frombuffer(frame, DATA)[0]
        blocks = packet["blocks"]
        mode, channels = ReturnMode(packet["mode"]), blocks["channels"]
        distances = channels["distance"].ravel()
        ranges = distances * np.float32(DISTANCE_LSB_M)
        ranges[distances == 0] = np.nan
        directions = directions_s(blocks["azimuth"], mode is ReturnMode.DUAL)
        stamp = Stamp(t_rx_ns, *self._clock.data_time(int(packet["time_us"])))
        return make_scan(stamp, ranges, point_arrays(directions, OFFSETS_S[mode], channels["reflectivity"]))

    def _position(self, frame: bytes, t_rx_ns: int) -> list[Measurement]:
        time_us, pps = int.from_bytes(frame[TIME_AT : TIME_AT + 4], "little"), frame[PPS_AT]
        sentence = read_sentence(frame[SENTENCE_AT:].rstrip(b"\0"))
        flags = tuple(flag for flag in (PPS_FLAGS[pps], sentence.flag) if flag)
        is_locked = pps == PPS_LOCKED and not sentence.flag
        utc_ns = self._clock.set_utc(time_us, sentence.utc_ns if is_locked else None)
        status = DeviceStatus(stamp=Stamp(t_rx_ns), ok=not flags, flags=flags)
        if utc_ns is None:
            return [status]
        return [status, DeviceTime(stamp=Stamp(t_rx_ns, utc_ns, TimeScale.UTC))]


def directions_s(azimuths: NDArray[np.uint16], is_dual: bool) -> Floats:
    """Unit vectors of all points, shape (POINTS, 3).

    azimuths : uint16, shape (BLOCKS,) [deg / 100];  is_dual : pairs of blocks have the same firings
    """
    firings = azimuths[::2] if is_dual else azimuths
    ways = np.mod(np.diff(firings.astype(np.int32)), TURN)
    ways = np.append(ways, ways[-1]).astype(np.float32)
    angles = (firings.astype(np.float32)[:, None] + ways[:, None] * _SHARE) * _LSB_RAD
    vectors = np.empty((*angles.shape, 3), np.float32)
    vectors[..., 0], vectors[..., 1], vectors[..., 2] = _COS * np.sin(angles), _COS * np.cos(angles), _SIN
    return (np.repeat(vectors, 2, axis=0) if is_dual else vectors).reshape(-1, 3)

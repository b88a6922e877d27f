"""Faults of the frames of an image, and of the packets of a scanner, while the drift over the ground is live.

Images pass through the bytes of their frames, with a check sum in each; packets of a scanner have none.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from fti import config as configuration
from fti.drivers import binary_struct
from fti.formats.array_points import directions_s
from fti.messages.measurements import RangeScan, Stamp
from fti.messages.outputs import GroundDrift
from fti.messages.reasons import Reason
from fti.ranging.scan_points import make_scan, point_arrays, scan_points
from tests.nav.test_ground_drift import (
    RANGE_SD,
    SIDE,
    Outputs,
    Turntable,
    drifts,
    events,
    fly,
    known_sensor,
    last_solution,
    north_error,
    ranges,
    waves,
)
from tests.nav.test_inertial_aiding import MS, T0

PARTS, HEADER, LENGTH = 10, 8, 8 + 2 * SIDE * SIDE // 10 + 4
#: Resolution of a range in a frame [m].
LSB_M = 0.02
SATELLITES_S, END_S = 60.0, 85.0
#: Faults of the frames begin here [s]: before, images are whole.
BEGIN_S = 15.0

Spoil = Callable[[list[bytes], np.random.Generator], list[bytes]]


def imager_options() -> binary_struct.Options:
    array: dict[str, Any] = {
        "at": HEADER,
        "type": "u16",
        "rows": SIDE,
        "columns": SIDE,
        "field_of_view_deg": [60, 60],
        "scale": LSB_M,
        "lost": [0],
        "parts": PARTS,
        "part_in": {"at": 6, "type": "u16"},
        "image_in": {"at": 4, "type": "u16"},
    }
    table = {"sync": "494d4147", "length": LENGTH, "checksum": {"kind": "crc32"}, "array": array}
    bound = configuration.bind(binary_struct.Options, table, "file.toml", "device[0].options")
    assert isinstance(bound, binary_struct.Options)
    return bound


class FramedImager:
    """Two images in a second, encoded; their frames with faults, decoded.

    sent : ranges of each image [m];  received : decoded scans, with the number of the image that was sent last
    """

    def __init__(self, spoil: Spoil, seed: int = 0) -> None:
        options = imager_options()
        assert options.array is not None
        self.decoder, self._encoder = binary_struct.make_decoder(options), binary_struct.make_encoder(options)
        self._rays = directions_s(options.array).astype(np.float64)
        self._spoil, self._rng = spoil, np.random.default_rng(seed)
        self.sent: list[np.ndarray[Any, np.dtype[np.float64]]] = []
        self.received: list[tuple[int, RangeScan]] = []
        self.bytes = 0

    def scans(self, k: int) -> list[RangeScan]:
        t, stamp = 0.01 * k, Stamp(T0 + k * 10 * MS)
        if k % 50:
            return []
        noise = RANGE_SD * np.random.default_rng(k).standard_normal(len(self._rays))
        self.sent.append(ranges(t, self._rays, waves) + noise)
        frames = self._encoder.encode(make_scan(stamp, self.sent[-1], point_arrays(self._rays, np.zeros(SIDE**2))))
        assert len(frames) == PARTS
        found = []
        for frame in frames if t < BEGIN_S else self._spoil(frames, self._rng):
            self.bytes += len(frame)
            found += [m for m in self.decoder.feed(frame, stamp.t_rx_ns) if isinstance(m, RangeScan)]
        self.received += [(len(self.sent) - 1, scan) for scan in found]
        return found


def lost(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    return [frame for frame in frames if rng.random() > 0.15]


def repeated(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    return [frame for frame in frames for _ in range(1 + (rng.random() < 0.3))]


def reordered(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    """Within an image."""
    first, *others = frames
    rng.shuffle(others)
    return [first, *others]


def truncated(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    return [frame[: rng.integers(1, LENGTH)] if rng.random() < 0.1 else frame for frame in frames]


def corrupted(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    return [_with_wrong_bits(frame, rng) if rng.random() < 0.1 else frame for frame in frames]


def _with_wrong_bits(frame: bytes, rng: np.random.Generator) -> bytes:
    data = bytearray(frame)
    for bit in rng.integers(0, 8 * len(data), rng.integers(1, 30)):
        data[bit // 8] ^= 1 << (bit % 8)
    return bytes(data)


def anything(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    """Each of the faults, in a random image; or an image in any order."""
    kinds: list[Spoil] = [lost, repeated, reordered, truncated, corrupted, lambda all_of, _: all_of]
    found = kinds[rng.integers(len(kinds))](frames, rng)
    if rng.random() < 0.1:
        rng.shuffle(found)
    return found


def whole_points(scan: RangeScan) -> int:
    return int(np.isfinite(scan_points(scan).ranges).sum())


def check_images(imager: FramedImager) -> None:
    """No point of one image is in another, and no wrong number is a range."""
    for last, scan in imager.received:
        found = scan_points(scan).ranges
        is_return = np.isfinite(found)
        images = imager.sent[max(last - 1, 0) : last + 1]
        assert any((abs(found - image)[is_return] < 0.51 * LSB_M).all() for image in images)


def check_drifts(out: Outputs, from_s: float) -> None:
    """Errors of pairs and of the filter are inside their sigma."""
    whole = [each for each in drifts(out, from_s) if each.directions == 3]
    errors = np.array([[each.north, each.east, each.down] for each in whole])
    sds = np.array([[each.north_sd, each.east_sd, each.down_sd] for each in whole])
    assert (np.abs(errors) < 5.0 * np.hypot(sds, [0.2, 0.4, 0.3])).all()  # with the true drift of the filter
    last = last_solution(out)
    assert last.valid and last.horizontal_sd is not None
    assert abs(north_error(last)) < 3.0 * last.horizontal_sd
    assert not any("contradict" in text for _, text in events(out))


@pytest.mark.parametrize("spoil", [lost, truncated, corrupted, anything])
def test_images_with_faults_are_no_wrong_drift(spoil: Spoil) -> None:
    imager = FramedImager(spoil)
    with known_sensor():
        out = fly(imager, satellites=lambda t: t < SATELLITES_S, end_s=END_S)
    check_images(imager)
    check_drifts(out, 20.0)
    counters = imager.decoder.counters
    assert counters.bytes_in == imager.bytes == counters.framed + sum(counters.skipped.values()) + counters.held
    assert counters.lost["frame"] > 50
    outage = drifts(out, SATELLITES_S + 2.0)
    assert sum(each.valid for each in outage) > 3  # the parts that came show the drift
    assert any(0 < (each.points or 0) < SIDE**2 for each in outage)


@pytest.mark.parametrize("spoil", [repeated, reordered])
def test_repeated_and_reordered_frames_give_whole_images(spoil: Spoil) -> None:
    imager = FramedImager(spoil)
    for k in range(0, 6000, 50):
        imager.scans(k)
    check_images(imager)
    assert len(imager.received) == len(imager.sent)
    assert all(whole_points(scan) == SIDE**2 for _, scan in imager.received)
    assert not imager.decoder.counters.lost


def test_images_without_their_first_frames_are_stale_drifts() -> None:
    """They have no time.  The drift is not valid after three intervals, and the filter coasts on."""
    imager = FramedImager(lambda frames, _: frames[1:])
    with known_sensor():
        out = fly(imager, end_s=40.0)
    assert len(imager.received) == BEGIN_S * 2
    late = [o for o in out if isinstance(o, GroundDrift) and o.t_ns > T0 + 30_000 * MS]
    assert late and {(o.valid, o.reasons) for o in late} == {(False, (Reason.STALE,))}


class SpoiledTurntable(Turntable):
    """A scanner whose packets are lost, repeated, exchanged with the next, and have wrong ranges and directions."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._rng, self._held = np.random.default_rng(seed), list[RangeScan]()
        self.faults = Counter[str]()

    def scans(self, k: int) -> list[RangeScan]:
        found: list[RangeScan] = []
        for scan in super().scans(k):
            kind = self._rng.choice(["none", "lost", "repeated", "late", "wrong"], p=[0.77, 0.1, 0.06, 0.06, 0.01])
            self.faults[kind] += 1
            held, self._held = self._held, []
            if kind == "late":
                self._held = [scan]
            elif kind == "wrong":
                found.append(self._with_wrong_points(scan))
            elif kind != "lost":
                found += [scan] * (1 + (kind == "repeated"))
            found += held
        return found

    def _with_wrong_points(self, scan: RangeScan) -> RangeScan:
        """A tenth of the ranges is any that a packet can state; a block of points has another azimuth."""
        points = scan_points(scan)
        values, rays = points.ranges.copy(), points.directions_s.copy()
        is_wrong = self._rng.random(len(values)) < 0.1
        values[is_wrong] = self._rng.uniform(1.0, 400.0, is_wrong.sum())
        angle = self._rng.uniform(0.0, 2.0 * math.pi)
        c, s = math.cos(angle), math.sin(angle)
        rays[64:96] = rays[64:96] @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        offsets = (points.times_ns - scan.stamp.t_rx_ns) * 1e-9
        return replace(make_scan(scan.stamp, values, point_arrays(rays, offsets)), valid=scan.valid)


def test_packets_with_faults_are_no_wrong_drift() -> None:
    scanner = SpoiledTurntable(seed=0)
    with known_sensor():
        out = fly(scanner, end_s=25.0, exposure_s=0.2)
    assert min(scanner.faults.values()) > 20
    assert sum(each.directions == 3 for each in drifts(out, 5.0)) > 4
    check_drifts(out, 5.0)

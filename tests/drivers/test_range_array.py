"""Arrays of ranges in described frames: directions, times, images in parts, and what a wrong option says."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest

from fti import config
from fti.drivers import binary_struct
from fti.errors import ConfigError
from fti.messages.measurements import RangeScan, Reading, Stamp
from fti.ranging.scan_points import make_scan, point_arrays, scan_points

#: Three rows of two pixels, one row in a frame: sync, image, part, two ranges in centimetres.
PARTS: dict[str, Any] = {
    "at": 5,
    "type": "u16",
    "rows": 3,
    "columns": 2,
    "field_of_view_deg": [20.0, 30.0],
    "scale": 0.01,
    "lost": [0, 65535],
    "row_time_s": 0.01,
    "point_time_s": 0.001,
    "parts": 3,
    "part_in": {"at": 4, "type": "u8"},
    "image_in": {"at": 2, "type": "u16"},
}
FRAME = {"sync": "a55a", "length": 9}


def options(array: dict[str, Any], **frame: Any) -> binary_struct.Options:
    table = {**FRAME, **frame, "array": array}
    bound = config.bind(binary_struct.Options, table, "file.toml", "device[0].options")
    assert isinstance(bound, binary_struct.Options)
    return bound


def without(*names: str, **changes: Any) -> dict[str, Any]:
    return {name: value for name, value in {**PARTS, **changes}.items() if name not in names}


def part(image: int, number: int, *centimetres: int) -> bytes:
    return b"\xa5\x5a" + struct.pack("<HB2H", image, number, *centimetres)


def scans(decoder: binary_struct.Decoder, *frames: bytes) -> list[RangeScan]:
    found = [m for k, frame in enumerate(frames) for m in decoder.feed(frame, 100 + k)]
    assert all(isinstance(m, RangeScan) for m in found)
    return [m for m in found if isinstance(m, RangeScan)]


def ranges(scan: RangeScan) -> list[float | None]:
    return [None if math.isnan(value) else round(value, 3) for value in scan_points(scan).ranges.tolist()]


def test_the_frames_of_an_image_become_one_scan_with_directions_and_times() -> None:
    decoder = binary_struct.make_decoder(options(PARTS))
    (scan,) = scans(decoder, part(7, 0, 1000, 1100), part(7, 1, 0, 1300), part(7, 2, 1400, 65535))
    assert ranges(scan) == [10.0, 11.0, None, 13.0, 14.0, None] and scan.stamp == Stamp(100)
    points = scan_points(scan)
    assert (points.times_ns - 100).tolist() == [0, 1_000_000, 10_000_000, 11_000_000, 20_000_000, 21_000_000]
    x, y = math.tan(math.radians(10.0)) / 2, math.tan(math.radians(15.0)) * 2 / 3
    expected = [(s * x, r * y, 1.0) for r in (-1, 0, 1) for s in (-1, 1)]
    np.testing.assert_allclose(points.directions_s / points.directions_s[:, 2:], expected, atol=1e-6)
    assert not decoder.counters.lost


def test_a_line_has_equal_angles_from_left_to_right() -> None:
    """Five points in 40 degrees; a negative field of view begins on the right."""
    line = without("parts", "part_in", "image_in", grid="lines", rows=2, columns=5, at=2)
    for sign in (1.0, -1.0):
        decoder = binary_struct.make_decoder(options({**line, "field_of_view_deg": [0.0, sign * 40.0]}, length=22))
        (scan,) = scans(decoder, b"\xa5\x5a" + struct.pack("<10H", *[500] * 10))
        directions = scan_points(scan).directions_s
        across = np.degrees(np.arctan2(directions[:, 1], directions[:, 2]))
        assert across == pytest.approx(sign * np.array([-20.0, -10.0, 0.0, 10.0, 20.0] * 2), abs=1e-4)
        assert not directions[:, 0].any()


def test_points_of_a_missing_frame_have_no_return() -> None:
    decoder = binary_struct.make_decoder(options(PARTS))
    first, second = scans(
        decoder, part(1, 0, 10, 20), part(1, 2, 50, 60), part(2, 0, 1, 2), part(2, 1, 3, 4), part(2, 2, 5, 6)
    )
    assert ranges(first) == [0.1, 0.2, None, None, 0.5, 0.6] and first.stamp == Stamp(100)
    assert ranges(second) == [0.01, 0.02, 0.03, 0.04, 0.05, 0.06] and second.stamp == Stamp(102)
    assert decoder.counters.lost == {"frame": 1}


def test_an_image_without_its_first_frame_is_dropped() -> None:
    decoder = binary_struct.make_decoder(options(PARTS))
    kept = scans(
        decoder,
        part(1, 1, 10, 20),
        part(1, 2, 30, 40),
        *(part(2, n, 5, 6) for n in range(3)),
        part(2, 2, 9, 9),
        part(2, 3, 9, 9),
    )
    assert [ranges(scan) for scan in kept] == [[0.05, 0.06] * 3]
    assert decoder.counters.lost == {"frame": 1} and decoder.counters.messages["frame"] == 7


def test_without_a_number_of_the_image_a_lower_part_begins_the_next_one() -> None:
    decoder = binary_struct.make_decoder(options(without("image_in")))
    found = scans(decoder, part(0, 0, 1, 2), part(0, 1, 3, 4), part(0, 0, 5, 6), part(0, 1, 7, 8), part(0, 2, 9, 10))
    assert [ranges(scan) for scan in found] == [
        [0.01, 0.02, 0.03, 0.04, None, None],
        [0.05, 0.06, 0.07, 0.08, 0.09, 0.1],
    ]


def test_an_image_of_eleven_kilobytes_is_one_frame_over_several_reads() -> None:
    """75 x 75 pixels of two bytes: 11,250; its checksum is over all of them."""
    array = without("parts", "part_in", "image_in", at=4, rows=75, columns=75)
    chosen = options(array, length=11_256, checksum={"kind": "crc16_xmodem"})
    values = np.random.default_rng(1).uniform(1.0, 300.0, 5625)
    values[::7] = np.nan
    sent = make_scan(Stamp(0), values, point_arrays(np.tile((0.0, 0.0, 1.0), (5625, 1)), np.zeros(5625)))
    (frame,) = binary_struct.make_encoder(chosen).encode(sent)
    assert len(frame) == 11_256
    decoder = binary_struct.make_decoder(chosen)
    pieces = [frame[at : at + 1472] for at in range(0, len(frame), 1472)]
    (scan,) = scans(decoder, *pieces, pieces[0])
    np.testing.assert_allclose(scan_points(scan).ranges, values, atol=0.00502)
    assert scan.stamp == Stamp(100) and decoder.counters.held == 1472
    damaged = bytearray(frame)
    damaged[5000] ^= 1
    assert scans(binary_struct.make_decoder(chosen), bytes(damaged)) == []


def test_the_emulated_device_divides_a_scan_and_sends_it_with_the_last_values_of_the_fields() -> None:
    fields = [{"name": "temperature", "at": 9, "type": "u8"}]
    chosen = options(PARTS, length=10, fields=fields)
    encoder, decoder = binary_struct.make_encoder(chosen), binary_struct.make_decoder(chosen)
    arrays = point_arrays(np.tile((0.0, 0.0, 1.0), (6, 1)), np.zeros(6))
    assert encoder.encode(Reading(stamp=Stamp(0), name="temperature", value=21.0)) == []
    for image in (0, 1):
        frames = encoder.encode(make_scan(Stamp(0), [1.0, 2.0, math.nan, 700.0, -1.0, 6.0], arrays))
        assert [struct.unpack_from("<HB", frame, 2) for frame in frames] == [(image, n) for n in range(3)]
        found = [m for frame in frames for m in decoder.feed(frame, 1)]
        assert [m.value for m in found if isinstance(m, Reading)] == [21.0] * 3
        assert [ranges(m) for m in found if isinstance(m, RangeScan)] == [[1.0, 2.0, None, None, None, 6.0]]
    assert encoder.encode(make_scan(Stamp(0), [1.0], point_arrays([(0.0, 0.0, 1.0)], [0.0]))) == []
    lost = encoder.encode(make_scan(Stamp(0), [1.0] * 6, arrays, valid=False))
    assert [m.returns for frame in lost for m in decoder.feed(frame, 1) if isinstance(m, RangeScan)] == [0]


def test_floats_limits_and_intensities() -> None:
    """Big-endian floats in metres, each with an intensity behind it; NaN and infinity are no ranges."""
    array = {
        "at": 2,
        "type": "f32",
        "step": 5,
        "rows": 1,
        "columns": 5,
        "field_of_view_deg": [1.0, 1.0],
        "limits": [2.0, 90.0],
        "intensity_at": 6,
    }
    chosen = options(array, length=27, byte_order="big")
    frame = b"\xa5\x5a" + b"".join(
        struct.pack(">fB", value, 10 * k) for k, value in enumerate((5.5, math.nan, math.inf, 1.0, 91.0))
    )
    (scan,) = scans(binary_struct.make_decoder(chosen), frame)
    intensities = scan_points(scan).intensities
    assert ranges(scan) == [5.5, None, None, None, None]
    assert intensities is not None and intensities.tolist() == [0, 10, 20, 30, 40]
    (again,) = binary_struct.make_encoder(chosen).encode(scan)
    assert again[2:7] == frame[2:7] and math.isnan(struct.unpack_from(">f", again, 7)[0]) and again[6::5] == frame[6::5]


@pytest.mark.parametrize(
    ("array", "sentence"),
    [
        (without(at=6), "array: ends at byte 10, the data at 9"),
        (without(parts=2), "array.parts = 2: must divide the 3 rows"),
        (without("part_in"), "array.part_in: must be given where there are several parts, and only there"),
        (without("lost"), "array.lost: must have a number for points without a return, of the type u16"),
        (without(lost=[-1]), "array.lost: -1 does not fit; allowed are whole numbers from 0 to 65535"),
        (without(scale=0), "array.scale = 0; must not be 0"),
        (without(limits=[3, 2]), "array.limits = [3.0, 2.0]; the first must be below"),
        (without(field_of_view_deg=[180, 20]), "array.field_of_view_deg = [180.0, 20.0]: of an image below 180"),
        (without(part_in={"at": 4, "type": "f32"}), "array.part_in: type = 'f32': must be unsigned"),
        (without(image_in={"at": 8, "type": "u32"}), "array.image_in: ends at byte 12, the data at 9"),
    ],
)
def test_a_wrong_option_is_named(array: dict[str, Any], sentence: str) -> None:
    with pytest.raises((ValueError, ConfigError)) as caught:
        binary_struct.make_decoder(options(array))
    assert sentence in str(caught.value)

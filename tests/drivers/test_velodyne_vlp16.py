"""Packets of the VLP-16: points against an independent decoder, refused packets, the clock, the emulated scanner."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from fti.drivers import velodyne_vlp16
from fti.drivers.velodyne_vlp16.options import Options
from fti.messages.measurements import DeviceStatus, DeviceTime, Measurement, RangeScan, Stamp, TimeScale
from fti.ranging.scan_points import make_scan, point_arrays, scan_points
from tests.drivers.vectorfiles import load

RECORDING, DUAL = load("velodyne_vlp16_recording"), load("velodyne_vlp16_dual")
PACKET = RECORDING.data[:1206]
POSITION = DUAL.data[:512]
HOUR_US = 3_600_000_000
#: Heights of the lasers above the origin, table 9-1 of the manual [m]; the independent decoder adds them.
MAX_HEIGHT_M = 0.0113
#: The independent decoder takes one mean rate for a packet; two azimuths in a row differ from it by 0.02 deg.
AZIMUTH_RAD = math.radians(0.03)


def decode(*packets: bytes, t_rx_ns: int = 5) -> list[Measurement]:
    decoder = velodyne_vlp16.make_decoder(Options())
    return [m for packet in packets for m in decoder.feed(packet, t_rx_ns)]


def scans(*packets: bytes) -> list[RangeScan]:
    return [m for m in decode(*packets) if isinstance(m, RangeScan)]


def changed(packet: bytes, at: int, new: bytes) -> bytes:
    return packet[:at] + new + packet[at + len(new) :]


def at_time(time_us: int) -> bytes:
    return changed(PACKET, 1200, struct.pack("<I", time_us))


def position(time_us: int = 316_400_000, pps: int = 2, sentence: bytes | None = None) -> bytes:
    text = POSITION[206:] if sentence is None else sentence.ljust(306, b"\0")
    return bytes(198) + struct.pack("<IBxxx", time_us, pps) + text


def test_points_are_those_of_an_independent_decoder() -> None:
    """Direction, time and intensity of every 17th point of two recorded packets, across azimuth 360 degrees."""
    found = [scan_points(scan) for scan in scans(RECORDING.data)]
    rows = RECORDING.facts["points"]["rows"]
    assert len(rows) > 25
    for packet, point, x, y, z, intensity, t_us in rows:
        points = found[packet]
        measured = points.ranges[point] * points.directions_s[point]
        side = math.hypot(x, y)
        assert math.hypot(measured[0] - x, measured[1] - y) < AZIMUTH_RAD * side + 1e-4
        assert math.hypot(measured[0], measured[1]) == pytest.approx(side, abs=1e-4)
        assert measured[2] == pytest.approx(z, abs=MAX_HEIGHT_M)
        assert points.intensities is not None and points.intensities[point] == intensity
        assert points.times_ns[point] == pytest.approx(5 + 1e3 * t_us, abs=1.0)


def test_directions_have_the_length_one_and_the_vertical_angles_of_the_lasers() -> None:
    points = scan_points(scans(PACKET)[0])
    np.testing.assert_allclose(np.linalg.norm(points.directions_s, axis=1), 1.0, atol=3e-7)
    up = np.degrees(np.arcsin(points.directions_s[:16, 2]))
    assert up == pytest.approx([-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15], abs=1e-4)


def test_both_returns_of_a_firing_have_one_direction_and_time() -> None:
    points = scan_points(scans(DUAL.data)[0])
    blocks = points.directions_s.reshape(12, 32, 3), points.times_ns.reshape(12, 32)
    for values in blocks:
        np.testing.assert_array_equal(values[::2], values[1::2])
    assert points.times_ns[-1] - points.times_ns[0] == pytest.approx(1e3 * (5 * 110.592 + 55.296 + 15 * 2.304), abs=1)
    azimuth = np.degrees(np.arctan2(points.directions_s[::64, 0], points.directions_s[::64, 1])) % 360.0
    assert azimuth == pytest.approx([359.0, 359.4, 359.8, 0.2, 0.6, 1.0], abs=1e-3)


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (changed(PACKET, 300, b"\xff\xdd"), "bad_flag"),
        (changed(PACKET, 702, struct.pack("<H", 36_000)), "bad_azimuth"),
        (changed(PACKET, 1204, b"\x41"), "other_return_mode"),
        (changed(PACKET, 1205, b"\x24"), "other_product"),
        (PACKET[:1000], "other_product"),
        (PACKET[:1010], "bad_flag"),
        (PACKET + b"\xff" * 40, "no_sync"),
        (position(pps=4), "bad_position_packet"),
        (position(sentence=b"$GPGGA,1"), "bad_position_packet"),
    ],
)
def test_a_wrong_packet_is_refused_with_a_reason_and_costs_no_other_one(packet: bytes, reason: str) -> None:
    decoder = velodyne_vlp16.make_decoder(Options())
    kept = [m for data in (PACKET, packet, PACKET, PACKET) for m in decoder.feed(data, 1)]
    whole = 4 if packet.startswith(PACKET) else 3
    assert sum(isinstance(m, RangeScan) for m in kept) == whole == decoder.counters.messages["data"]
    assert decoder.counters.skipped[reason] > 0
    assert decoder.counters.skipped.total() == len(packet) - (len(PACKET) if whole == 4 else 0)


def test_the_time_of_an_hour_goes_on_over_its_end_and_late_packets() -> None:
    stamps = [scan.stamp for scan in scans(*map(at_time, (HOUR_US - 2000, HOUR_US - 1000, 500, HOUR_US - 500, 1500)))]
    times = [HOUR_US - 2000, HOUR_US - 1000, HOUR_US + 500, HOUR_US - 500, HOUR_US + 1500]
    assert stamps == [Stamp(5, 1000 * t_us, TimeScale.BOOT) for t_us in times]


def test_with_a_locked_pulse_the_time_is_that_of_utc() -> None:
    """Half a second before and after the hour, with a sentence of the old second."""
    sentence = b"$GPRMC,225959,A,5133.82,N,00042.24,W,173.8,231.8,130694,004.2,W*72\r\n"
    before, after = HOUR_US - 500_000, 500_000
    packets = (
        position(before, sentence=sentence),
        at_time(before),
        at_time(after),
        position(after + 400_000, pps=0),
        at_time(7),
    )
    status, time, *found = decode(*packets)
    hour_ns = 771_548_400 * 10**9  # date -u -d '1994-06-13 23:00' +%s
    assert status == DeviceStatus(stamp=Stamp(5), ok=True)
    assert time == DeviceTime(stamp=Stamp(5, hour_ns - 500_000_000, TimeScale.UTC))
    assert [m.stamp.t_dev_ns for m in found[:2]] == [hour_ns - 500_000_000, hour_ns + 500_000_000]
    assert [m.stamp.time_scale for m in found[:2]] == [TimeScale.UTC] * 2
    assert found[2] == DeviceStatus(stamp=Stamp(5), ok=False, flags=("pps_absent",))
    assert found[3].stamp.time_scale is TimeScale.BOOT


@pytest.mark.parametrize(
    ("sentence", "flag"),
    [
        (b"", "no_gprmc"),
        (b"$GPRMC,220516,A,5133.82,N,00042.24,W,173.8,231.8,130694,004.2,W*71\r\n", "bad_gprmc"),
        (b"$GPRMC,996099,A*0C\r\n", "bad_gprmc"),
        (b"$GPRMC,,V,,,,,,,,,,N*53\r\n", "gnss_not_valid"),
    ],
)
def test_a_sentence_that_confirms_no_clock_is_named(sentence: bytes, flag: str) -> None:
    assert decode(position(sentence=sentence)) == [DeviceStatus(stamp=Stamp(5), ok=False, flags=(flag,))]


def test_a_decoder_after_missing_frames_keeps_the_hour() -> None:
    first = velodyne_vlp16.make_decoder(Options())
    first.feed(position() + DUAL.data[512:1718], 1)
    second = velodyne_vlp16.make_decoder(Options())
    second.copy_state(first)
    (scan,) = second.feed(at_time(316_500_200), 2)
    assert scan.stamp.time_scale is TimeScale.UTC


def test_the_emulated_scanner_sends_lost_and_invalid_points_as_zero_and_no_other_scan() -> None:
    down = point_arrays([(0.0, 0.0, 1.0)] * 384, [0.0] * 384, [9] * 384)
    ranges = [math.nan, 500.0, 0.0004, -1.0, *[10.0] * 380]
    encoder = velodyne_vlp16.make_encoder(Options(return_mode="last"))
    (packet,) = encoder.encode(make_scan(Stamp(HOUR_US * 1000 + 3_000), ranges, down))
    assert [struct.unpack_from("<H", packet, 4 + 3 * k)[0] for k in range(5)] == [0, 65535, 0, 0, 5000]
    assert packet[1200:] == struct.pack("<IBB", 3, 0x38, 0x22) and packet[6] == 9
    (packet,) = encoder.encode(make_scan(Stamp(0), ranges, down, valid=False))
    assert scans(packet)[0].returns == 0
    assert encoder.encode(make_scan(Stamp(0), [1.0], point_arrays([(0.0, 0.0, 1.0)], [0.0]))) == []

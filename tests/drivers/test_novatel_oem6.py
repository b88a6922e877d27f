"""NovAtel OEM6: frames, values calculated by hand, invalid values, round trips."""

from __future__ import annotations

import math
import struct
from typing import TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from fti.drivers import novatel_oem6 as novatel
from fti.drivers.novatel_oem6 import clock, messages, observations, sky, solution, status
from fti.drivers.novatel_oem6.framing import (
    SHORT_HEADER,
    SHORT_SYNC,
    NovatelHeader,
    crc32,
    encode_frame,
    split,
)
from fti.drivers.novatel_oem6.signals import SIGNALS, decode_tracking
from fti.formats.device_time import gps_ns
from fti.messages.measurements import (
    DeviceStatus,
    Measurement,
    Position,
    Pseudorange,
    Pseudoranges,
    Reading,
    ReceiverClock,
    Satellite,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)

M = TypeVar("M")
WEEK, MS = 1949, 403_742_000
T_GPS_NS = gps_ns(WEEK, MS * 1_000_000)
STAMP = Stamp(5, T_GPS_NS, TimeScale.GPS)
HEADER = NovatelHeader(b"", 0, 0, 0, 32, 0, 0, 100, 180, WEEK, MS, 0, 0, 0)
#: BESTPOS at 48.1 deg, 11.5 deg, 500 m, with an undulation of 46.5 m.
BESTPOS = bytes.fromhex(
    "aa44121c2a0000204800000064b49d07309d101800000000bacd00800000000010000000cdcccccccc0c48400000000000002740"
    "0000000000407f4000003a423d000000cdcc8c3f0000803f00000040000000000000000000000000" + "0c0b0b0900060003ba36448c"
)


def frame(number: int, body: bytes, **header: int) -> bytes:
    return encode_frame(HEADER._replace(message_id=number, **header), body)  # type: ignore[arg-type]


def decode(data: bytes) -> list[Measurement]:
    return novatel.make_decoder(novatel.Options()).feed(data, 5)


def only(data: bytes, kind: type[M]) -> M:
    (found,) = [m for m in decode(data) if isinstance(m, kind)]
    return found


def bestpos(**changed: float) -> bytes:
    """BESTPOS with some fields changed."""
    names = ("status", "kind", "lat", "lon", "height", "undulation", "datum", "lat_sd", "lon_sd", "height_sd")
    values = list(solution.BESTPOS.unpack_from(BESTPOS, 28))
    for name, value in changed.items():
        values[names.index(name)] = value
    return frame(messages.BESTPOS, solution.BESTPOS.pack(*values))


# -------------------------------------------------------------------------------------------------------- frames


def test_checksum_is_that_of_the_document() -> None:
    assert crc32(b"123456789") == 0x2DFD2D88


def test_a_longer_header_moves_the_body() -> None:
    """The header says how long it is; a receiver may append to it."""
    long = bytearray(BESTPOS[:-4])
    long[3] = 32
    long[28:28] = b"more"
    position = only(bytes(long) + crc32(long).to_bytes(4, "little"), Position)
    assert position.lat == pytest.approx(math.radians(48.1))
    assert position.valid


def test_what_the_second_antenna_says_is_counted_and_not_mixed_in() -> None:
    decoder = novatel.make_decoder(novatel.Options())
    assert decoder.feed(frame(messages.BESTPOS, BESTPOS[28:-4], message_type=1), 5) == []
    assert decoder.counters.messages == {"BESTPOS of the second antenna": 1}
    assert len(decoder.feed(frame(messages.BESTPOS, BESTPOS[28:-4], message_type=2), 5)) == 1  # an OEMV


def test_short_headers_and_ascii_are_counted_by_name() -> None:
    short = SHORT_HEADER.pack(SHORT_SYNC, 8, 507, WEEK, MS) + bytes(8)
    short += crc32(short).to_bytes(4, "little")
    text = b"VERSIONA,COM1,0,50.0,FINE,1949,1.0,0,0,0;1,GPSCARD"
    line = b"#%s*%08x\r\n" % (text, crc32(text))
    decoder = novatel.make_decoder(novatel.Options())
    assert decoder.feed(short + line + frame(2000, b"") + b"\r\n[COM1]", 5) == []
    assert decoder.counters.messages == {"INSPVA": 1, "VERSIONA": 1, "message 2000": 1}
    assert decoder.counters.skipped == {"no_sync": 2, "prompt": 6}
    damaged = novatel.make_decoder(novatel.Options())
    damaged.feed(line.replace(b"GPSCARD", b"GPSCARE") + short[:-1] + b"!" + BESTPOS, 5)
    assert damaged.counters.messages == {"BESTPOS": 1}


@pytest.mark.parametrize(
    ("at", "value"),
    [(8, 0xFF), (9, 0x0F), (3, 27), (3, 65)],
    ids=["body longer than the message", "body of 3911 bytes", "header too short", "header too long"],
)
def test_a_damaged_length_costs_no_waiting(at: int, value: int) -> None:
    damaged = bytearray(BESTPOS)
    damaged[at] = value
    decoder = novatel.make_decoder(novatel.Options())
    decoder.feed(bytes(damaged), 5)
    assert decoder.counters.held < 2
    assert len(decoder.feed(BESTPOS, 6)) == 1


def test_a_count_that_contradicts_the_length_costs_no_waiting() -> None:
    data = frame(messages.RANGE, observations.COUNT.pack(80) + bytes(80 * observations.RANGE.size))
    damaged = data[:28] + observations.COUNT.pack(81) + data[32:]
    decoder = novatel.make_decoder(novatel.Options())
    decoder.feed(damaged[:33], 5)
    assert decoder.counters.skipped["bad_length"] == 1
    assert decoder.counters.held < 2


def test_a_range_of_all_channels_is_longer_than_other_messages_may_be() -> None:
    decoder = novatel.make_decoder(novatel.Options())
    body = observations.COUNT.pack(240) + bytes(240 * observations.RANGE.size)
    (found,) = decoder.feed(frame(messages.RANGE, body), 5)
    assert isinstance(found, Pseudoranges)
    assert len(found.observations) == 240
    decoder.feed(frame(2000, bytes(5000)), 5)
    assert decoder.counters.messages["message 2000"] == 0


# ------------------------------------------------------------------------------------------------- values by hand


def test_position_has_both_heights_in_si() -> None:
    position = only(BESTPOS, Position)
    assert position.lat == pytest.approx(0.8395033702, abs=1e-10)
    assert position.lon == pytest.approx(0.2007128640, abs=1e-10)
    assert (position.alt, position.alt_msl, position.undulation) == (546.5, 500.0, 46.5)
    assert position.horizontal_sd == pytest.approx(math.sqrt((1.1**2 + 1.0**2) / 2), abs=1e-6)
    assert (position.vertical_sd, position.valid) == (2.0, True)
    assert position.stamp == Stamp(5, T_GPS_NS, TimeScale.GPS)


def test_velocity_is_down_positive_and_as_old_as_its_latency() -> None:
    """36 km/h to the south-west, climbing 2 m/s, true a quarter of a second ago."""
    body = solution.BESTVEL.pack(0, 8, 0.25, 0.0, 10.0, 225.0, 2.0, 0.0)
    velocity = only(frame(messages.BESTVEL, body), Velocity)
    assert (velocity.ground_speed, velocity.down) == (10.0, -2.0)
    assert velocity.track == pytest.approx(3.92699, abs=1e-5)
    assert velocity.north == pytest.approx(-7.0711, abs=1e-4)
    assert velocity.east == pytest.approx(-7.0711, abs=1e-4)
    assert velocity.stamp.t_dev_ns == T_GPS_NS - 250_000_000


def test_metres_of_the_clock_model_are_seconds() -> None:
    """299.792458 m are a microsecond."""
    covariance = (0.09, 0.0, 0.0, 0.0, 0.0004, 0.0, 0.0, 0.0, 0.0)
    body = clock.CLOCKMODEL.pack(0, 0, MS, MS, 299.792458, -2.99792458, 0.0, *covariance, 1.0, 2.0, 0)
    receiver_clock = only(frame(messages.CLOCKMODEL, body), ReceiverClock)
    assert receiver_clock.offset == pytest.approx(1e-6)
    assert receiver_clock.drift == pytest.approx(-1e-8)
    assert receiver_clock.offset_sd == pytest.approx(0.3 / 299_792_458.0)
    assert receiver_clock.drift_sd == pytest.approx(0.02 / 299_792_458.0)
    assert receiver_clock.valid


def test_a_range_has_the_sign_of_the_phase_turned_and_that_of_the_doppler_kept() -> None:
    """GLONASS slot 14, channel -7; it comes nearer: the Doppler is positive, and the phase becomes smaller."""
    word = 0x08119F04 & ~(7 << 16) | 1 << 16
    body = observations.COUNT.pack(1) + observations.RANGE.pack(
        51, 0, 19271851.0, 0.05, -102729811.5, 0.01, 824.75, 49.0, 12.5, word
    )
    (o,) = only(frame(messages.RANGE, body), Pseudoranges).observations
    assert (o.system, o.number, o.signal) == ("glonass", 14, "L1C")
    assert (o.pseudorange, o.carrier_phase, o.doppler) == (19271851.0, 102729811.5, 824.75)
    assert (o.cn0_dbhz, o.lock_time, o.carrier_hz) == (49.0, 12.5, 1598.0625e6)


def test_satellites_above_the_horizon_have_directions_in_radians() -> None:
    entries = [(5, 45.0, 90.0), (51, 30.0, 180.0), (7, -10.0, 20.0), (120, 20.0, 270.0)]
    body = sky.SATVIS.pack(1, 1, len(entries)) + b"".join(
        sky.ENTRY.pack(n, 0, 0, up, azimuth, 0.0, 0.0) for n, up, azimuth in entries
    )
    satellites = only(frame(messages.SATVIS, body), Satellites).satellites
    assert [(s.system, s.number) for s in satellites] == [("gps", 5), ("glonass", 14), ("sbas", 120)]
    assert satellites[0].azimuth == pytest.approx(math.pi / 2)
    assert satellites[0].elevation == pytest.approx(math.pi / 4)


def test_satellites_of_qzss_are_numbered_within_their_system_as_other_receivers_do() -> None:
    """193 is J01, as of a u-blox or in NMEA: otherwise the same satellite is two."""
    entry = sky.ENTRY.pack(193, 0, 0, 10.0, 5.0, 0.0, 0.0)
    dop = sky.PSRDOP.pack(2.5, 2.0, 1.2, 1.5, 1.0, 5.0, 1) + struct.pack("<I", 193)
    for number, body in (
        (messages.SATVIS, sky.SATVIS.pack(1, 1, 1) + entry),
        (messages.SATVIS2, sky.SATVIS2.pack(7, 1, 1, 1) + entry),
        (messages.PSRDOP, dop),
    ):
        (found,) = only(frame(number, body), Satellites).satellites
        assert (found.system, found.number) == ("qzss", 1)
    word = 5 << 16 | 1 << 10 | 1 << 12
    body = observations.COUNT.pack(1) + observations.RANGE.pack(194, 0, 4e7, 0.1, -2e8, 0.01, 5.0, 45.0, 9.0, word)
    (o,) = only(frame(messages.RANGE, body), Pseudoranges).observations
    assert (o.system, o.number) == ("qzss", 2)
    assert (
        observations.RANGE.unpack_from(observations.encode_range(Pseudoranges(stamp=Stamp(5), observations=(o,))), 4)[0]
        == 194
    )
    measurements = Satellite(system="qzss", number=3, azimuth=0.1, elevation=0.2, used=True)
    (back,) = sky.encode_satvis2(Satellites(stamp=Stamp(5), satellites=(measurements,)))
    assert sky.ENTRY.unpack_from(back, sky.SATVIS2.size)[0] == 195


def test_vertical_dilution_is_what_the_others_leave() -> None:
    body = sky.PSRDOP.pack(2.5, 2.0, 1.2, 1.5, 1.0, 5.0, 2) + struct.pack("<2I", 5, 51)
    satellites = only(frame(messages.PSRDOP, body), Satellites)
    assert satellites.pdop == 2.0
    assert satellites.hdop == pytest.approx(1.2)
    assert satellites.vdop == pytest.approx(1.6)
    assert [(s.system, s.number, s.used) for s in satellites.satellites] == [("gps", 5, True), ("glonass", 14, True)]


# ------------------------------------------------------------------------------------------------- what is not valid


@pytest.mark.parametrize(
    "changed",
    [
        {"status": 1},
        {"status": 6},
        {"kind": 0},
        {"kind": 1},
        {"kind": 19},
        {"kind": 72},
        {"datum": 63},
        {"lat": math.nan},
        {"lon": math.inf},
        {"height": math.nan},
        {"undulation": math.nan},
        {"lat": 90.1},
        {"lon": -180.1},
        {"lon": 180.1},
    ],
    ids=str,
)
def test_a_position_without_solution_in_wgs84_is_not_valid(changed: dict[str, float]) -> None:
    position = only(bestpos(**changed), Position)
    assert not position.valid
    assert all(x is None or math.isfinite(x) for x in (position.lat, position.lon, position.alt, position.alt_msl))


@pytest.mark.parametrize("kind", [2, 16, 17, 18, 32, 34, 50, 69])
def test_a_position_of_every_kind_of_solution_is_valid(kind: int) -> None:
    assert only(bestpos(kind=kind), Position).valid


@pytest.mark.parametrize("numbers", [(1, 8, 5.0), (0, 0, 5.0), (0, 19, 5.0), (0, 8, math.nan)])
def test_a_velocity_without_solution_is_not_valid(numbers: tuple[int, int, float]) -> None:
    code, kind, speed = numbers
    body = solution.BESTVEL.pack(code, kind, math.nan, 0.0, speed, 10.0, 0.0, 0.0)
    velocity = only(frame(messages.BESTVEL, body), Velocity)
    assert not velocity.valid
    assert velocity.stamp.t_dev_ns == T_GPS_NS  # a latency that is no number is none


@pytest.mark.parametrize("time_status", [20, 60, 80, 100, 120, 140, 200, 0, 255])
def test_a_time_that_the_receiver_does_not_know_is_no_device_time(time_status: int) -> None:
    assert only(frame(messages.BESTPOS, BESTPOS[28:-4], time_status=time_status), Position).stamp == Stamp(5)


@pytest.mark.parametrize("time_status", [130, 160, 170, 180])
def test_a_known_time_is_the_device_time(time_status: int) -> None:
    data = frame(messages.BESTPOS, BESTPOS[28:-4], time_status=time_status)
    assert only(data, Position).stamp.t_dev_ns == T_GPS_NS


def test_milliseconds_beyond_the_week_are_no_device_time() -> None:
    data = frame(messages.BESTPOS, BESTPOS[28:-4], milliseconds=604_800_000)
    assert only(data, Position).stamp.t_dev_ns is None


@pytest.mark.parametrize(("model", "utc"), [(0, 0), (0, 2), (1, 1), (3, 1)])
def test_clock_and_utc_say_what_they_are_worth(model: int, utc: int) -> None:
    """1 is valid for UTC (2 is a default number of leap seconds), 0 for the clock (1 is converging)."""
    body = clock.TIME.pack(model, 1e-9, 1e-9, -18.0, 2017, 5, 18, 16, 8, 44000, utc)
    measurements = decode(frame(messages.TIME, body))
    assert [m.valid for m in measurements if isinstance(m, ReceiverClock)] == [model == 0]
    assert [m.valid for m in measurements if isinstance(m, Reading)] == [utc == 1]


def test_a_dilution_of_9999_is_none() -> None:
    satellites = only(frame(messages.PSRDOP, sky.PSRDOP.pack(9999.0, 9999.0, 9999.0, 1.0, 1.0, 5.0, 0)), Satellites)
    assert (satellites.pdop, satellites.hdop, satellites.vdop, satellites.used) == (None, None, None, 0)


def test_directions_that_the_receiver_does_not_vouch_for_are_not_given() -> None:
    entry = sky.ENTRY.pack(5, 0, 0, 45.0, 90.0, 0.0, 0.0)
    assert decode(frame(messages.SATVIS, sky.SATVIS.pack(0, 1, 1) + entry)) == []
    assert decode(frame(messages.SATVIS2, sky.SATVIS2.pack(0, 0, 1, 1) + entry)) == []


def test_what_is_not_locked_is_not_measured() -> None:
    locked = 0x0810BC04
    for word, ranged, phased in (
        (locked, True, True),
        (locked & ~(1 << 12), False, True),
        (locked & ~(1 << 10), True, False),
    ):
        body = observations.COUNT.pack(1) + observations.RANGE.pack(5, 0, 2e7, 0.1, -1e8, 0.01, 5.0, 45.0, 9.0, word)
        (o,) = only(frame(messages.RANGE, body), Pseudoranges).observations
        assert (o.pseudorange is not None, o.carrier_phase is not None, o.doppler is not None) == (
            ranged,
            phased,
            phased,
        )


def test_errors_are_named_and_the_receiver_is_not_ok() -> None:
    body = status.HEAD.pack(1 << 15, 1) + status.WORD.pack(1 << 0 | 1 << 6, 0, 0, 0)
    device_status = only(frame(messages.RXSTATUS, body), DeviceStatus)
    assert (device_status.ok, device_status.flags) == (False, ("nvm_error", "error", "antenna_shorted"))
    assert not only(frame(messages.RXSTATUS, status.HEAD.pack(1 << 31, 0)), DeviceStatus).ok
    harmless = status.HEAD.pack(0, 1) + status.WORD.pack(1 << 19 | 1 << 18 | 1 << 22, 0, 0, 0)
    device_status = only(frame(messages.RXSTATUS, harmless), DeviceStatus)
    assert (device_status.ok, device_status.flags) == (
        True,
        ("almanac_invalid", "position_invalid", "clock_model_invalid"),
    )


# ---------------------------------------------------------------------------------------------------- round trips

known_signals = st.sampled_from(
    [
        (system, signal.name)
        for system, table in SIGNALS.items()
        for signal in {s.name: s for s in table.values()}.values()
    ]
)


@given(known_signals, st.floats(1.5e7, 4.5e7), st.floats(-3e8, 3e8), st.floats(-6000.0, 6000.0), st.integers(-7, 6))
def test_an_observation_comes_back_to_half_the_resolution_of_the_wire(
    signal: tuple[str, str], pseudorange: float, phase: float, doppler: float, channel: int
) -> None:
    system, name = signal
    band = next(s for s in SIGNALS[system].values() if s.name == name)
    step = {1602.0: 0.5625e6, 1246.0: 0.4375e6}.get(band.mhz, 0.0) if system == "glonass" else 0.0
    sent = Pseudorange(
        system=system, number=7, signal=name, pseudorange=pseudorange, pseudorange_sd=0.5, carrier_phase=phase,
        carrier_phase_sd=0.25, doppler=doppler, cn0_dbhz=45.5, lock_time=12.25,
        carrier_hz=band.mhz * 1e6 + step * channel,
    )  # fmt: skip
    encoder = novatel.make_encoder(novatel.Options(unasked=True))
    (data,) = encoder.encode(Pseudoranges(stamp=STAMP, observations=(sent,)))
    (measurements,) = only(data, Pseudoranges).observations
    assert measurements.doppler == pytest.approx(doppler, abs=2.0**-12)
    assert replace(measurements, doppler=doppler) == sent


@given(st.lists(st.integers(0, 159), unique=True))
def test_every_status_bit_comes_back(bits: list[int]) -> None:
    flags = tuple(status.BITS[b // 32][b % 32] for b in sorted(bits))
    data = frame(messages.RXSTATUS, status.encode_rxstatus(DeviceStatus(stamp=STAMP, ok=True, flags=flags)))
    assert only(data, DeviceStatus).flags == flags


@given(st.integers(0, 2**32 - 1))
def test_every_tracking_word_is_read(word: int) -> None:
    t = decode_tracking(word)
    assert t.system == ("gps", "glonass", "sbas", "galileo", "beidou", "qzss", "navic", "other")[word >> 16 & 7]
    assert t.name == (t.signal.name if t.signal else f"signal_{word >> 21 & 31}")


def test_directions_and_dilution_come_back() -> None:
    satellites = tuple(
        Satellite(system=system, number=n, azimuth=0.1 * n, elevation=0.05 * n, used=True)
        for system in ("gps", "glonass", "galileo")
        for n in (3, 9, 24)
    )
    encoder = novatel.make_encoder(novatel.Options(unasked=True))
    sent = Satellites(stamp=STAMP, satellites=satellites, used=9, hdop=0.75, vdop=1.0, pdop=1.25)
    frames = encoder.encode(sent)
    dop, *views = [m for f in frames for m in decode(f) if isinstance(m, Satellites)]
    assert [split(f)[0].sequence for f in frames] == [0, 2, 1, 0]  # SATVIS2 counts down its systems
    assert (dop.used, dop.hdop, dop.vdop, dop.pdop) == (9, 0.75, 1.0, 1.25)
    measurements = [s for view in views for s in view.satellites]
    assert len(views) == 3
    for a, b in zip(measurements, satellites, strict=True):
        assert (a.system, a.number) == (b.system, b.number)
        assert a.azimuth == pytest.approx(b.azimuth)
        assert a.elevation == pytest.approx(b.elevation)

"""iXCOM: velocity frames and height datums of the data selection, validity, unknown values."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

import ixcom.data
import numpy as np
import pyproj
import pytest
from ixcom.crc16 import crc16xmodem
from ixcom.protocol import DataSelectionMask as Mask
from ixcom.protocol import GlobalStatusBit
from scipy.spatial.transform import Rotation

from fti.drivers import imar_ixcom as ix
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.drivers.imar_ixcom.status import STATUS_FLAGS, decode_status, encode_status
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    ImuSample,
    Measurement,
    Position,
    PressureAltitude,
    Stamp,
    TimeScale,
    Velocity,
)

LAT, LON = 0.84, 0.2
RPY = (0.1, -0.05, 2.5)
NED = (60.0, -10.0, 3.0)
GOOD = 0xB400
DEFAULT_SELECTION = Mask.IMUCORR | Mask.VELNED | Mask.ALTITUDE_WGS84 | Mask.WGS84POS


def frame(selection: int, vel: Sequence[float] = NED, status: int = GOOD, **fields: Any) -> bytes:
    """INSSOL as the maker's package writes it."""
    message = ixcom.data.getMessageWithID(3)
    message.header.msgID, message.header.week = 3, 2300
    message.bottom.gStatus = status
    content: dict[str, Any] = {
        "acc": [0.5, -0.25, -9.75],
        "omg": [0.01, -0.02, 0.03],
        "rpy": list(RPY),
        "vel": list(vel),
    }
    content |= {"lon": LON, "lat": LAT, "alt": 500.0, "undulation": 4725, "DatSel": int(selection)}
    message.payload.data.update(content | fields)
    return bytes(message.to_bytes())


def decode(data: bytes, **options: Any) -> dict[type, Any]:
    measurements = ix.make_decoder(ix.Options(**options)).feed(data, 1)
    assert len({type(m) for m in measurements}) == len(measurements)
    return {type(m): m for m in measurements}


def assert_ned(velocity: Velocity, tolerance: float = 1e-5) -> None:
    assert (velocity.north, velocity.east, velocity.down) == pytest.approx(NED, abs=tolerance)


def test_velocity_in_enu() -> None:
    assert_ned(decode(frame(Mask.VELENU, (NED[1], NED[0], -NED[2])))[Velocity])


def test_velocity_in_the_body_frame() -> None:
    roll, pitch, heading = (float(np.float32(x)) for x in RPY)
    mat_nb = Rotation.from_euler("ZYX", [heading, pitch, roll])
    assert_ned(decode(frame(Mask.VELBDY, mat_nb.inv().apply(NED)))[Velocity])


def test_velocity_in_the_earth_frame() -> None:
    """The earth-fixed velocity is the difference of two earth-fixed positions, as PROJ has them."""
    ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    geod = pyproj.Geod(ellps="WGS84")
    dt, lon, lat = 0.01, math.degrees(LON), math.degrees(LAT)
    lon_n, lat_n, _ = geod.fwd(lon, lat, math.degrees(math.atan2(NED[1], NED[0])), math.hypot(*NED[:2]) * dt)
    here, there = np.array(ecef.transform(lon, lat, 0.0)), np.array(ecef.transform(lon_n, lat_n, -NED[2] * dt))
    assert_ned(decode(frame(Mask.VELECEF, (there - here) / dt))[Velocity], tolerance=2e-4)


def test_height_above_the_ellipsoid_mean_sea_level_and_barometric() -> None:
    place = Mask.WGS84POS
    ellipsoid = decode(frame(place | Mask.ALTITUDE_WGS84))[Position]
    assert (ellipsoid.alt, ellipsoid.alt_msl, ellipsoid.undulation) == (500.0, 452.75, 47.25)
    msl = decode(frame(place | Mask.ALTITUDE_MSL))[Position]
    assert (msl.alt, msl.alt_msl, msl.undulation) == (547.25, 500.0, 47.25)
    baro = decode(frame(place | Mask.ALTITUDE_BARO))
    assert baro[PressureAltitude].alt_press == 500.0
    assert (baro[Position].alt, baro[Position].alt_msl) == (None, None)


def test_an_undulation_of_zero_is_no_geoid() -> None:
    found = decode(frame(Mask.WGS84POS | Mask.ALTITUDE_MSL, undulation=0))[Position]
    assert (found.alt, found.alt_msl, found.undulation) == (None, 500.0, None)


def test_what_the_message_does_not_say_is_not_made_up() -> None:
    assert set(decode(frame(Mask.ECEFPOS | Mask.RPY_DIN70000))) == {DeviceStatus}
    assert ImuSample not in decode(frame(Mask.VELNED))  # nobody says which inertial data these are
    assert ImuSample in decode(frame(Mask.IMURAW))
    assert Velocity not in decode(frame(Mask.VELBDY | Mask.RPY_DIN70000))


def test_nothing_selected_means_what_the_option_says() -> None:
    assert decode(frame(0))[Position].alt == 500.0
    assert decode(frame(0), data_selection=int(Mask.WGS84POS | Mask.ALTITUDE_MSL))[Position].alt_msl == 500.0


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_numbers_that_are_none_do_not_pass(number: float) -> None:
    every = Mask.IMUCORR | Mask.ALTITUDE_WGS84 | Mask.WGS84POS
    lost: dict[str, Any] = {"acc": [number] * 3, "rpy": [number] * 3, "lat": number, "alt": number}
    for mask in (Mask.VELNED, Mask.VELENU, Mask.VELECEF, Mask.VELBDY):
        content = decode(frame(every | mask, **lost))
        assert {ImuSample, Attitude, Position}.isdisjoint(content)
        assert (Velocity in content) == (mask in (Mask.VELNED, Mask.VELENU))


@pytest.mark.parametrize(
    ("status", "ok", "attitude", "position"),
    [
        (GOOD, True, True, True),
        (GOOD | GlobalStatusBit.GNSSINVALID, True, True, True),
        (GOOD | GlobalStatusBit.HWERROR, False, False, False),
        (GOOD | GlobalStatusBit.COMERROR, False, False, False),
        (GOOD | GlobalStatusBit.NAVERROR, False, False, False),
        (GOOD | GlobalStatusBit.STANDBY, False, False, False),
        (0x9400, True, False, True),  # aligning
        (0xF400, True, True, False),  # position undefined
        (0x3400, True, True, False),  # position bad
        (0x7400, True, True, True),  # position medium
    ],
)
def test_status_decides_what_is_valid(status: int, ok: bool, attitude: bool, position: bool) -> None:
    content = decode(frame(DEFAULT_SELECTION, status=int(status)))
    assert content[DeviceStatus].ok is ok
    assert content[Attitude].valid is attitude
    assert content[Velocity].valid is attitude
    assert content[Position].valid is position


def test_status_names_are_those_of_the_maker() -> None:
    for bit, name in enumerate(GlobalStatusBit):
        assert decode_status(int(name)) == (STATUS_FLAGS[bit], "levelling", "position_bad"), name
        assert encode_status(decode_status(int(name))) == int(name)


def test_crc_is_xmodem() -> None:
    assert crc16xmodem(b"123456789") == 0x31C3
    data = encode_frame(0x98, 5, 0, 0, struct.pack("<dff", 1.0, 100.0, 0.5))
    assert crc16xmodem(data[:-2]).to_bytes(2, "little") == data[-2:]


def test_an_inssol_of_another_length_is_counted_and_not_decoded() -> None:
    decoder = ix.make_decoder(ix.Options())
    assert decoder.feed(encode_frame(NUMBERS["INSSOL"], 0, 0, GOOD, bytes(10)), 1) == []
    assert decoder.counters.messages == {"INSSOL of unknown length": 1}


def sent(measurements: Sequence[Measurement]) -> list[Measurement]:
    encoder, decoder = ix.make_encoder(ix.Options()), ix.make_decoder(ix.Options())
    return [m for given in measurements for data in encoder.encode(given) for m in decoder.feed(data, 1)]


def test_the_emulated_system_joins_only_what_is_of_the_same_time() -> None:
    now, before = Stamp(2_000_000_000), Stamp(1_000_000_000)
    measurements = sent([
        Attitude(stamp=before, roll=0.1, pitch=0.1, heading=0.1),
        Velocity(stamp=now, north=1.0, east=2.0, down=3.0),
        Position(stamp=now, lat=LAT, lon=LON, alt=100.0),
    ])  # fmt: skip
    assert [type(m) for m in measurements] == [DeviceStatus, Velocity, Position]


def test_the_emulated_system_sends_the_time_and_validity() -> None:
    stamp = Stamp(5, 2300 * 604_800 * 10**9 + 123_456_789_000, TimeScale.GPS)
    measurements = sent([
        DeviceStatus(stamp=stamp, ok=False, flags=("gnss_invalid",)),
        Attitude(stamp=stamp, roll=0.0, pitch=0.0, heading=0.0, valid=False),
        Position(stamp=stamp, lat=LAT, lon=LON, alt=100.0, valid=False),
    ])  # fmt: skip
    assert [m.stamp.t_dev_ns for m in measurements] == [stamp.t_dev_ns] * 3
    assert [getattr(m, "valid", None) for m in measurements] == [None, False, False]
    assert isinstance(measurements[0], DeviceStatus)
    assert measurements[0].flags == ("gnss_invalid", "aligning", "position_undefined")

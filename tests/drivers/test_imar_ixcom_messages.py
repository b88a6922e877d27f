"""iXCOM messages other than INSSOL: layouts, units, non-finite values.  Reference: the maker's package."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import ixcom.data
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ixcom.protocol import SysstatBit

from fti.drivers import imar_ixcom as ix
from fti.drivers.imar_ixcom import deviations, environment_messages, inertial, satellites, solution
from fti.drivers.imar_ixcom.messages import TABLE, IxcomMessage
from fti.drivers.imar_ixcom.options import NAMES, NUMBERS
from fti.drivers.imar_ixcom.satellites import SOLUTIONS, TYPES
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.messages.measurements import (
    Airspeed,
    DeviceStatus,
    ImpactPressure,
    ImuSample,
    MagneticField,
    Position,
    PressureAltitude,
    Satellites,
    StaticPressure,
    Temperature,
    Velocity,
)
from fti.messages.tables import Message
from tests.drivers.ixcom_frames import GNSS, GOOD, INSSOL, decode, frame, only, readings

STRUCTS = {
    "IMURAW": inertial.IMU, "IMUCORR": inertial.IMU, "IMUCOMP": inertial.IMU, "INSSOL": solution.INSSOL,
    "INSRPY": solution.THREE, "INSVELNED": solution.THREE, "INSVELENU": solution.THREE,
    "INSPOSLLH": solution.POSITION, "INSGNDSPEED": solution.THREE, "EKFSTDDEV": deviations.EKFSTDDEV,
    "GNSSSOL": satellites.GNSSSOL, "AIRDATA": environment_messages.AIRDATA, "MAGDATA": environment_messages.MAGDATA,
    "WHEELDATA": environment_messages.WHEELDATA, "EXTHEIGHT": environment_messages.EXTHEIGHT,
}  # fmt: skip

# ------------------------------------------------------------------------------------------------------- layouts


def fields_of(layout: str) -> str:
    """A format of ``struct`` with every field by itself; reserved bytes are padding."""
    return "".join(c * int(n or 1) for n, c in re.findall(r"(\d*)([a-zA-Z])", layout)).replace("x", "B")


def test_every_layout_is_that_of_the_maker() -> None:
    assert set(STRUCTS) | {"SYSSTAT"} == {message.name for message in TABLE}
    for name, layout in STRUCTS.items():
        theirs = ixcom.data.getMessageWithID(NUMBERS[name]).payload.structString
        assert fields_of(layout.format) == fields_of(theirs), name


def test_names_are_those_of_the_maker() -> None:
    others = {"TEMP", "NTRIPSTAT", "IMU_FILTERED", "MAGHDG", "ResponsePayload"}  # its source calls them otherwise
    for number, payload in ixcom.data.MessagePayloadDictionary.items():
        if number in NAMES and payload.get_name() not in others:
            assert NAMES[number] == payload.get_name()


@pytest.mark.parametrize("name", sorted(STRUCTS))
def test_a_message_of_another_length_is_counted_and_not_decoded(name: str) -> None:
    decoder = ix.make_decoder(ix.Options())
    for size in (0, STRUCTS[name].size - 1, STRUCTS[name].size + 1):
        assert decoder.feed(encode_frame(NUMBERS[name], 0, 0, GOOD, bytes(size)), 1) == []
    assert decoder.counters.messages == {f"{name} of unknown length": 3}


def numbers(value: object) -> Iterator[float]:
    """Every float in a measurement."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, tuple):
        for one in value:
            yield from numbers(one)
    elif isinstance(value, Message):
        for name in value.__struct_fields__:
            yield from numbers(getattr(value, name))


@given(st.data(), st.sampled_from(TABLE), st.integers(0, 0xFFFF))
def test_whatever_stands_in_a_whole_frame_no_number_comes_out_that_is_none(
    data: st.DataObject, message: IxcomMessage, footer: int
) -> None:
    size = data.draw(st.integers(0, 80)) if message.size is None else message.size
    payload = data.draw(st.binary(min_size=size, max_size=size) | st.sampled_from([b"\xff" * size, bytes(size)]))
    decoder = ix.make_decoder(ix.Options())
    for m in decoder.feed(encode_frame(NUMBERS[message.name], 0, 0, footer, payload), 1):
        assert all(math.isfinite(number) for number in numbers(m)), m


@given(st.integers(0, 255), st.binary(max_size=100))
def test_frames_of_every_number_are_counted_once(number: int, payload: bytes) -> None:
    decoder = ix.make_decoder(ix.Options())
    decoder.feed(encode_frame(number, 0, 0, GOOD, payload), 1)
    assert sum(decoder.counters.messages.values()) == 1
    assert decoder.counters.framed == len(payload) + 20


# -------------------------------------------------------------------------------------------- inertial data


@pytest.mark.parametrize("name", ["IMURAW", "IMUCORR"])
def test_what_feels_gravity_is_specific_force(name: str) -> None:
    imu = only(ImuSample, decode(frame(name, acc=[0.0, 0.0, -9.75], omg=[0.25, 0.0, 0.0])))
    assert (imu.accel_b, imu.gyro_b) == ((0.0, 0.0, -9.75), (0.25, 0.0, 0.0))


def test_what_does_not_feel_gravity_is_never_specific_force() -> None:
    free = {"acc": [0.5, 0.0, 0.25], "omg": [0.25, 0.0, 0.0]}
    for data in (frame("IMUCOMP", **free), frame("INSSOL", **INSSOL | free | {"DatSel": 0x048C})):
        measurements = decode(data)
        assert not any(isinstance(m, ImuSample) for m in measurements)
        assert readings(measurements)["accel_gravity_free_z"] == 0.25
        assert readings(measurements)["gyro_earth_rate_free_x"] == 0.25


# ----------------------------------------------------------------------------------------------- GNSS solution


def test_gnss_deviations_are_the_largest_of_their_axes() -> None:
    measurements = decode(frame("GNSSSOL", **GNSS, stdDevPos=[1.5, 2.0, 3.0], stdDevVel=[0.125, 0.25, 0.0625]))
    position, velocity = only(Position, measurements), only(Velocity, measurements)
    assert (position.horizontal_sd, position.vertical_sd, velocity.sd) == (2.0, 3.0, 0.25)


def test_gnss_height_is_above_mean_sea_level() -> None:
    position = only(Position, decode(frame("GNSSSOL", **GNSS)))
    assert (position.alt_msl, position.undulation, position.alt) == (452.75, 47.25, 500.0)
    position = only(Position, decode(frame("GNSSSOL", **GNSS | {"undulation": 0.0})))
    assert (position.alt_msl, position.undulation, position.alt) == (452.75, None, None)


@pytest.mark.parametrize(("solved", "kind", "valid"), [(0, 16, True), (1, 16, False), (0, 0, False), (77, 16, False)])
def test_only_a_computed_gnss_solution_is_valid(solved: int, kind: int, valid: bool) -> None:
    measurements = decode(frame("GNSSSOL", **GNSS | {"solStatus": solved, "posType": kind}))
    assert only(Position, measurements).valid is valid
    assert only(Velocity, measurements).valid is valid
    flags = only(DeviceStatus, measurements).flags
    assert f"gnss_solution_{SOLUTIONS.get(solved, solved)}" in flags
    assert f"gnss_type_{TYPES.get(kind, kind)}" in flags


def test_a_gnss_solution_that_the_system_calls_invalid_is_not_valid() -> None:
    invalid = 1 << 6
    status = {"footer": GOOD | invalid}, {"gnssStatus": 1 << 17}
    for text in status:
        measurements = decode(frame("GNSSSOL", **GNSS | text))
        assert (only(Position, measurements).valid, only(Velocity, measurements).valid) == (False, False)
    timeout = frame("SYSSTAT", varsize=0, statMode=0, sysStat=1 << 17)
    assert not only(Position, decode(timeout, frame("GNSSSOL", **GNSS))).valid


def test_a_velocity_from_the_doppler_shift_is_no_position() -> None:
    measurements = decode(frame("GNSSSOL", **GNSS | {"posType": 8}))
    assert (only(Position, measurements).valid, only(Velocity, measurements).valid) == (False, True)


def test_a_gnss_solution_without_numbers_is_none() -> None:
    lost = {"lat": math.nan, "velNED": [math.nan] * 3, "pdop": math.inf}
    measurements = decode(frame("GNSSSOL", **GNSS | lost))
    assert not any(isinstance(m, Position | Velocity) for m in measurements)
    assert only(Satellites, measurements).pdop is None


# ------------------------------------------------------------------------------------ air data, magnetometer


def test_air_data_in_si() -> None:
    """By hand: 1013.25 hPa = 101325 Pa, 22.5 hPa = 2250 Pa, -5 degrees Celsius = 268.15 K."""
    measurements = decode(frame("AIRDATA", TAS=62.5, IAS=60.0, baroAlt=1000.0, Pd=22.5, Ps=1013.25, OAT=-5.0))
    assert only(StaticPressure, measurements).p_static == pytest.approx(101325.0, abs=0.01)
    assert only(ImpactPressure, measurements).q_c == 2250.0
    assert only(Temperature, measurements).static == 268.15
    assert only(PressureAltitude, measurements).alt_press == 1000.0
    assert (only(Airspeed, measurements).tas, only(Airspeed, measurements).ias) == (62.5, 60.0)


def test_air_data_that_timed_out_or_are_no_numbers_are_not_valid() -> None:
    timeout = frame("SYSSTAT", varsize=0, statMode=0, sysStat=int(SysstatBit.MADC_TIMEOUT))
    stale = decode(timeout, frame("AIRDATA", TAS=62.5, Ps=1000.0))
    assert not only(Airspeed, stale).valid
    assert not only(StaticPressure, stale).valid
    lost = decode(frame("AIRDATA", **dict.fromkeys(("TAS", "IAS", "baroAlt", "Pd", "Ps", "OAT"), math.nan)))
    assert not only(Airspeed, lost).valid
    assert not any(isinstance(m, StaticPressure | ImpactPressure | Temperature | PressureAltitude) for m in lost)


@pytest.mark.parametrize(("unit", "north"), [("nT", 18_000.0), ("uT", 18.0), ("mG", 180.0), ("G", 0.18)])
def test_a_field_of_18_microtesla_in_every_unit(unit: str, north: float) -> None:
    measurements = decode(frame("MAGDATA", field=[north, 0.0, 0.0], magHdg=0.5), magnetometer_unit=unit)
    assert only(MagneticField, measurements).field_b[0] == pytest.approx(18e-6, rel=1e-6)
    assert readings(measurements)["magnetic_heading"] == 0.5


def test_a_magnetometer_that_timed_out_is_not_valid() -> None:
    timeout = frame("SYSSTAT", varsize=0, statMode=0, sysStat=int(SysstatBit.MAG_TIMEOUT))
    assert not only(MagneticField, decode(timeout, frame("MAGDATA", field=[1.0, 2.0, 3.0]))).valid


def test_an_external_height_that_is_not_valid_is_none() -> None:
    assert readings(decode(frame("EXTHEIGHT", height=120.0, solution_valid=1)))["external_height"] == 120.0
    assert readings(decode(frame("EXTHEIGHT", height=120.0, solution_valid=0)))["external_height"] is None

"""AIRDATA, MAGDATA, WHEELDATA, EXTHEIGHT: values of other sensors that the system forwards.

    AIRDATA 0x17, 48 B    0 TAS f | 4 IAS f [m/s] | 8 pressure altitude f [m] | 12 its rate f [m/s]
                          16 dynamic pressure f | 20 static pressure f [hPa]  | 24 outside air temperature f [deg C]
                          28 bias f [m] | 32 scale f, estimated by the filter | 36, 40 their sd | 44 status u32
    MAGDATA 0x18, 32 B    0 field 3f [option magnetometer_unit], along the magnetometer's axes
                          12 heading f | 16 bank f | 20 elevation f | 24 deviation f [rad] | 28 status u32
    WHEELDATA 0x16, 8 B   0 speed f [m/s] | 4 counted pulses i32
    EXTHEIGHT 0x98, 24 B  0 time d [s] | 8 height f above WGS84 [m] | 12 its sd f [m] | 16 valid u8 | 17 reserved

The dynamic pressure is total minus static pressure: impact pressure.  The altimeter setting is unknown: None.  The axes
of the magnetometer are those of the body if it is mounted accordingly.  The bits of the two status words are not
published and are numbered; a timeout of the air-data computer or the magnetometer in SYSSTAT makes its values invalid.
"""

from __future__ import annotations

import struct

from fti.drivers.imar_ixcom.decoder_state import DecoderState
from fti.drivers.imar_ixcom.encoder_state import EncoderState
from fti.drivers.imar_ixcom.generic_values import (
    GenericValue,
    all_finite,
    decode_generic_values,
    encode_generic_values,
    nan_if_none,
)
from fti.drivers.imar_ixcom.options import TESLA
from fti.drivers.imar_ixcom.status import decode_word, encode_word, word_names
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.formats.unit_factors import HECTOPASCAL, KELVIN_AT_0_C
from fti.messages.measurements import (
    Airspeed,
    ImpactPressure,
    MagneticField,
    Measurement,
    PressureAltitude,
    StaticPressure,
    Temperature,
)

AIRDATA = struct.Struct("<11fI")
MAGDATA = struct.Struct("<7fI")
WHEELDATA = struct.Struct("<fi")
EXTHEIGHT = struct.Struct("<dffB7x")
AIR_STATUS, MAGNETOMETER_STATUS = word_names("air_data"), word_names("magnetometer")
RATE = GenericValue("pressure_altitude_rate", "m/s")
ESTIMATES = (
    GenericValue("pressure_altitude_bias", "m"),
    GenericValue("pressure_altitude_scale"),
    GenericValue("pressure_altitude_bias_sd", "m"),
    GenericValue("pressure_altitude_scale_sd"),
)
MAGNETIC = tuple(GenericValue(f"magnetic_{name}", "rad") for name in ("heading", "bank", "elevation", "deviation"))
WHEEL = (GenericValue("odometer_speed", "m/s"), GenericValue("odometer_pulses"))
HEIGHT = (
    GenericValue("external_height_time", "s"),
    GenericValue("external_height_sd", "m"),
    GenericValue("external_height", "m"),
)


# ------------------------------------------------------------------------------------------------------ air data


def decode_airdata(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """Estimates, altitude, pressures, temperature, and then the airspeeds."""
    tas, ias, altitude, rate, dynamic, static, celsius, *estimates, word = AIRDATA.unpack(frame.payload)
    decoder_state.set_status_words("AIRDATA", frame.stamp, decode_word(word, AIR_STATUS))
    stamp, valid = frame.stamp, "madc_timeout" not in decoder_state.flags(frame)
    measurements: list[Measurement] = [*decode_generic_values(stamp, (RATE, *ESTIMATES), (rate, *estimates))]
    if all_finite(altitude):
        measurements.append(PressureAltitude(stamp=stamp, alt_press=altitude, valid=valid))
    if all_finite(dynamic):
        measurements.append(ImpactPressure(stamp=stamp, q_c=dynamic * HECTOPASCAL, valid=valid))
    if all_finite(static):
        measurements.append(StaticPressure(stamp=stamp, p_static=static * HECTOPASCAL, valid=valid))
    if all_finite(celsius):
        measurements.append(Temperature(stamp=stamp, static=celsius + KELVIN_AT_0_C, valid=valid))
    speeds = [speed if all_finite(speed) else None for speed in (tas, ias)]
    measurements.append(Airspeed(stamp=stamp, tas=speeds[0], ias=speeds[1], valid=valid and speeds != [None, None]))
    return measurements


def encode_airdata(speed: Airspeed, encoder_state: EncoderState) -> bytes:
    """Payload of an airspeed, with the preceding pressures and temperature."""
    now = speed.stamp
    rate, *estimates = encode_generic_values((RATE, *ESTIMATES), encoder_state.readings)
    return AIRDATA.pack(
        nan_if_none(speed.tas),
        nan_if_none(speed.ias),
        encoder_state.value(PressureAltitude, "alt_press", now),
        rate,
        encoder_state.value(ImpactPressure, "q_c", now) / HECTOPASCAL,
        encoder_state.value(StaticPressure, "p_static", now) / HECTOPASCAL,
        encoder_state.value(Temperature, "static", now) - KELVIN_AT_0_C,
        *estimates,
        encode_word(encoder_state.flags, AIR_STATUS),
    )


# -------------------------------------------------------------------------------------------------- magnetometer


def decode_magdata(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """Heading and angles of the system, and then the field."""
    *field, heading, bank, elevation, deviation, word = MAGDATA.unpack(frame.payload)
    decoder_state.set_status_words("MAGDATA", frame.stamp, decode_word(word, MAGNETOMETER_STATUS))
    measurements: list[Measurement] = [
        *decode_generic_values(frame.stamp, MAGNETIC, (heading, bank, elevation, deviation))
    ]
    if all_finite(*field):
        unit = TESLA[decoder_state.options.magnetometer_unit]
        x, y, z = (unit * value for value in field)
        valid = "mag_timeout" not in decoder_state.flags(frame)
        measurements.append(MagneticField(stamp=frame.stamp, field_b=(x, y, z), valid=valid))
    return measurements


def encode_magdata(magnetic: MagneticField, encoder_state: EncoderState) -> bytes:
    """Payload of a field."""
    unit = TESLA[encoder_state.magnetometer_unit]
    angles = encode_generic_values(MAGNETIC, encoder_state.readings)
    word = encode_word(encoder_state.flags, MAGNETOMETER_STATUS)
    return MAGDATA.pack(*(value / unit for value in magnetic.field_b), *angles, word)


# -------------------------------------------------------------------------------------------- odometer, altimeter


def decode_wheeldata(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """Speed and counted pulses of the odometer."""
    return [*decode_generic_values(frame.stamp, WHEEL, WHEELDATA.unpack(frame.payload))]


def decode_extheight(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """The height that the system was given from outside."""
    time, height, sd, known = EXTHEIGHT.unpack(frame.payload)
    return [*decode_generic_values(frame.stamp, HEIGHT, (time, sd, height if known else float("nan")))]


def encode_extheight(height: float, sd: float, time: float) -> bytes:
    """Payload of EXTHEIGHT.  height above WGS84 [m], NaN: not valid; sd [m]; time : GPS second of the week [s]."""
    return EXTHEIGHT.pack(time, height, sd, all_finite(height))

"""GNSSSOL: solution of the GNSS receiver in the system, at its primary antenna.

    0x12, 84 B    0 longitude d | 8 latitude d [rad]  | 16 altitude f [m] above mean sea level | 20 undulation f [m]
                  24 velocity north, east, down 3f [m/s] | 36 sd longitude, latitude, altitude 3f [m]
                  48 sd of the velocity 3f [m/s] | 60 solution status u16 | 62 solution type u16 | 64 PDOP f
                  68 satellites used u8 | 69 tracked u8 | 70 base station u16 | 72 differential age f [s]
                  76 solution age f [s] | 80 receiver status u32

It is valid if a solution was computed, and neither the footer nor the status words of receiver and system report
invalid or timeout; a Doppler solution is a velocity without position.  An undulation of exactly 0 means "no geoid
model".
"""

from __future__ import annotations

import math
import struct

from fti.drivers.imar_ixcom.decoder_state import DecoderState
from fti.drivers.imar_ixcom.deviations import largest
from fti.drivers.imar_ixcom.encoder_state import EncoderState
from fti.drivers.imar_ixcom.generic_values import (
    GenericValue,
    all_finite,
    decode_generic_values,
    encode_generic_values,
    nan_if_none,
)
from fti.drivers.imar_ixcom.status import GNSS, decode_word, encode_word
from fti.drivers.imar_ixcom.wire import IxcomFrame
from fti.messages.measurements import Measurement, Position, Satellites, Velocity

GNSSSOL = struct.Struct("<ddff3f3f3fHHfBBHffI")
SOLUTIONS = {
    0: "computed", 1: "insufficient_obs", 2: "no_convergence", 3: "singularity", 4: "cov_trace", 5: "test_dist",
    6: "cold_start", 7: "v_h_limit", 8: "variance", 9: "residuals", 10: "delta_pos", 11: "negative_var",
    13: "integrity_warning", 18: "pending", 19: "invalid_fix", 20: "unauthorized", 21: "antenna_warning",
}  # fmt: skip
TYPES = {
    0: "none", 1: "fixedpos", 2: "fixedheight", 8: "doppler_velocity", 16: "single", 17: "psrdiff", 18: "sbas",
    19: "propagated", 20: "omnistar", 32: "l1_float", 33: "ionofree_float", 34: "narrow_float", 48: "l1_int",
    49: "wide_int", 50: "narrow_int", 64: "omnistar_hp", 65: "omnistar_xp", 68: "ppp_converging", 69: "ppp",
}  # fmt: skip
ITEMS = (
    GenericValue("gnss_satellites_tracked"),
    GenericValue("gnss_base_station"),
    GenericValue("gnss_differential_age", "s"),
    GenericValue("gnss_solution_age", "s"),
)
DOPPLER = 8
INVALID = frozenset({"gnss_invalid", "gnss_solution_invalid", "sysstat_gnss_invalid", "gnss_timeout"})
SOLUTION, TYPE = "gnss_solution_", "gnss_type_"


def decode_gnsssol(frame: IxcomFrame, decoder_state: DecoderState) -> list[Measurement]:
    """Satellites, velocity and position of the receiver; its status is added to the flags."""
    v = GNSSSOL.unpack(frame.payload)
    solution, kind, pdop, used, tracked, base, differential_age, age, word = v[13:22]
    flags = (f"{SOLUTION}{SOLUTIONS.get(solution, solution)}", f"{TYPE}{TYPES.get(kind, kind)}")
    decoder_state.set_status_words("GNSSSOL", frame.stamp, flags + decode_word(word, GNSS))
    valid = solution == 0 and kind != 0 and INVALID.isdisjoint(decoder_state.flags(frame))
    return [
        *decode_generic_values(frame.stamp, ITEMS, (tracked, base, differential_age, age)),
        Satellites(stamp=frame.stamp, used=used, pdop=pdop if math.isfinite(pdop) else None),
        *_velocity(frame, v, valid),
        *_position(frame, v, valid and kind != DOPPLER),
    ]


def _velocity(frame: IxcomFrame, v: tuple[float, ...], valid: bool) -> list[Velocity]:
    north, east, down = v[4:7]
    if not all_finite(north, east, down):
        return []
    return [Velocity(stamp=frame.stamp, north=north, east=east, down=down, sd=largest(v[10:13]), valid=valid)]


def _position(frame: IxcomFrame, v: tuple[float, ...], valid: bool) -> list[Position]:
    lon, lat, altitude, height_of_geoid = v[0:4]
    if not all_finite(lon, lat):
        return []
    alt_msl = altitude if math.isfinite(altitude) else None
    undulation = height_of_geoid if height_of_geoid and math.isfinite(height_of_geoid) else None
    return [
        Position(
            stamp=frame.stamp,
            lat=lat,
            lon=lon,
            alt=None if alt_msl is None or undulation is None else alt_msl + undulation,
            alt_msl=alt_msl,
            undulation=undulation,
            horizontal_sd=largest(v[7:9]),
            vertical_sd=largest(v[9:10]),
            valid=valid,
        )
    ]


def encode_gnsssol(position: Position, encoder_state: EncoderState) -> bytes:
    """Payload of a position of the receiver, with the preceding velocity, satellites and flags."""
    now = position.stamp
    used = encoder_state.value(Satellites, "used", now)
    tracked, base, differential_age, age = encode_generic_values(ITEMS, encoder_state.readings)
    flags = (
        encoder_state.flags if position.valid else (f"{SOLUTION}insufficient_obs", f"{TYPE}none", *encoder_state.flags)
    )
    sd = nan_if_none(position.horizontal_sd)
    return GNSSSOL.pack(
        nan_if_none(position.lon),
        nan_if_none(position.lat),
        nan_if_none(position.alt_msl),
        position.undulation or 0.0,
        *(encoder_state.value(Velocity, part, now) for part in ("north", "east", "down")),
        sd,
        sd,
        nan_if_none(position.vertical_sd),
        *[encoder_state.value(Velocity, "sd", now)] * 3,
        _number(flags, SOLUTION, SOLUTIONS, 0),
        _number(flags, TYPE, TYPES, 16),
        encoder_state.value(Satellites, "pdop", now),
        _count(used),
        _count(tracked),
        _count(base),
        differential_age,
        age,
        encode_word(flags, GNSS),
    )


def _number(flags: tuple[str, ...], prefix: str, names: dict[int, str], usual: int) -> int:
    numbers = {f"{prefix}{name}": number for number, name in names.items()}
    return next((numbers[flag] for flag in flags if flag in numbers), usual)


def _count(value: float) -> int:
    return int(value) if math.isfinite(value) else 0

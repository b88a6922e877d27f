"""iXCOM: deviations, every status bit, and their maximum age.  Reference: the maker's package."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from ixcom.protocol import EKF_STATUS_HIGH, EKF_STATUS_LOW, SysstatBit
from scipy.spatial.transform import Rotation

from fti.drivers import imar_ixcom as ix
from fti.drivers.imar_ixcom import status
from fti.drivers.imar_ixcom.deviations import StandardDeviations
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.messages.measurements import Attitude, DeviceStatus, Position, Stamp, Velocity
from tests.drivers.ixcom_frames import GOOD, INSSOL, decode, frame, only

# --------------------------------------------------------------------------------------------------- deviations


def test_deviations_reach_what_comes_within_five_seconds() -> None:
    sds = frame("EKFSTDDEV", pos=[1.5, 2.0, 0.75], vel=[0.125, 0.25, 0.0625], tilt=[0.5, 0.5, 0.125])
    decoder = ix.make_decoder(ix.Options())
    for at_s, known in ((0, True), (5, True), (6, False)):
        decoder.feed(sds, 0)
        measurements = decoder.feed(frame("INSSOL", **INSSOL), at_s * 10**9)
        position, velocity, attitude = (only(kind, measurements) for kind in (Position, Velocity, Attitude))
        assert (position.horizontal_sd, position.vertical_sd) == ((2.0, 0.75) if known else (None, None))
        assert velocity.sd == (0.25 if known else None)
        assert attitude.heading_sd == (0.125 if known else None)
        assert (attitude.roll_sd is not None) is known


def test_tilts_become_roll_and_pitch_as_a_rotation_does() -> None:
    """Many attitudes with small independent tilts about north and east: the scatter of their roll and pitch."""
    chance, sd_n, sd_e = np.random.default_rng(1), 2e-3, 1e-3
    roll, pitch, heading = 0.3, 0.4, 0.9
    mat_nb = Rotation.from_euler("ZYX", [heading, pitch, roll])
    tilts = np.stack([chance.normal(0.0, sd_n, 50_000), chance.normal(0.0, sd_e, 50_000), np.zeros(50_000)], axis=1)
    _, pitches, rolls = (Rotation.from_rotvec(tilts) * mat_nb).as_euler("ZYX").T
    text = StandardDeviations(tilt_north=sd_n, tilt_east=sd_e)
    assert text.roll(pitch, heading) == pytest.approx(rolls.std(), rel=0.02)
    assert text.pitch(heading) == pytest.approx(pitches.std(), rel=0.02)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_what_is_no_deviation_is_none(bad: float) -> None:
    sds = frame("EKFSTDDEV", pos=[bad, 2.0, bad], vel=[0.125, bad, 0.0625], tilt=[0.5, bad, bad])
    measurements = decode(sds, frame("INSSOL", **INSSOL))
    assert only(Position, measurements).horizontal_sd is None
    assert only(Position, measurements).vertical_sd is None
    assert only(Velocity, measurements).sd is None
    attitude = only(Attitude, measurements)
    assert (attitude.roll_sd, attitude.pitch_sd, attitude.heading_sd) == (None, None, None)


# ------------------------------------------------------------------------------------------------------- status


def system_flags(**words: Any) -> set[str]:
    names = {"gnssStat": 2, "ekfStat": 16, "sysStat2": 512}
    mode = sum(bit for name, bit in names.items() if name in words)
    measurements = decode(frame("SYSSTAT", varsize=mode, **{"statMode": mode, "sysStat": 0} | words))
    return set(only(DeviceStatus, measurements).flags) - set(status.HEALTHY)


def test_every_bit_of_the_system_status_has_the_name_of_the_maker() -> None:
    ours = {"gnss_invalid": "sysstat_gnss_invalid", "reserved": "zupt_request"}
    for bit in SysstatBit:
        assert bit.name is not None
        name = bit.name.lower()
        assert system_flags(sysStat=bit.value) == {ours.get(name, name)}


def test_every_bit_of_the_filter_status_has_the_name_of_the_maker() -> None:
    for low in EKF_STATUS_LOW:
        assert system_flags(ekfStat=[low.value, 0]) == {str(low.name).lower()}
    for high in EKF_STATUS_HIGH:
        assert system_flags(ekfStat=[0, high.value]) == {str(high.name).lower()}


def test_bits_that_the_header_alone_names() -> None:
    assert system_flags(gnssStat=1 << 0 | 1 << 10 | 1 << 23) == {
        "gnss_invalid_firmware", "gnss_primary_antenna_open", "gnss_secondary_antenna_power",
    }  # fmt: skip
    assert system_flags(gnssStat=1 << 31) == {"gnss_status_bit_31"}
    assert system_flags(sysStat2=3) == {"maintiming_error", "rtc_error"}


def test_no_two_bits_share_a_name() -> None:
    words = (status.SYSTEM, status.EKF_LOW, status.EKF_HIGH, status.GNSS, status.SYSTEM_2)
    names = [*status.STATUS_FLAGS, *status.ALIGNMENT, *status.QUALITY, *(name for word in words for name in word)]
    assert len(names) == len(set(names)) == 12 + 8 + 5 * 32


def test_a_mode_that_does_not_fit_the_length_is_refused() -> None:
    decoder = ix.make_decoder(ix.Options())
    for mode in (1, 1 << 10, 0xFFFFFFFF):
        payload = mode.to_bytes(4, "little") + bytes(4)
        assert decoder.feed(encode_frame(NUMBERS["SYSSTAT"], 0, 0, GOOD, payload), 1) == []
    assert decoder.counters.messages == {"SYSSTAT of unknown length": 3}


def test_system_errors_stay_in_the_status_for_five_seconds() -> None:
    decoder = ix.make_decoder(ix.Options())
    decoder.feed(frame("SYSSTAT", varsize=0, statMode=0, sysStat=int(SysstatBit.EKF_ERROR)), 0)
    for at_s, ok in ((1, False), (5, False), (6, True)):
        reported = only(DeviceStatus, decoder.feed(frame("INSSOL", **INSSOL), at_s * 10**9))
        assert reported.ok is ok
        assert ("ekf_error" in reported.flags) is not ok


def test_status_is_reported_when_it_changes_by_any_message() -> None:
    raw = {footer: frame("IMURAW", footer=footer) for footer in (GOOD, GOOD | 0x20)}
    measurements = decode(raw[GOOD], raw[GOOD], raw[GOOD | 0x20], raw[GOOD | 0x20], raw[GOOD])
    assert [m.ok for m in measurements if isinstance(m, DeviceStatus)] == [True, False, True]


def test_a_clock_that_gnss_has_not_set_is_no_device_time() -> None:
    for name in ("INSSOL", "IMURAW"):
        measurements = decode(frame(name, footer=GOOD | 0x200))
        assert {m.stamp for m in measurements} == {Stamp(0)}

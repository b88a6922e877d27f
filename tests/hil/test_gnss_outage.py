"""An outage as each protocol says it: in every field that a receiver has, decoded by our drivers and by others'."""

from __future__ import annotations

import io
import math
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pynmeagps
import pytest
from novatel_edie import oem
from pyubx2 import UBXReader

from fti import config, drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers.novatel_oem6.messages import BESTPOS
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.sensors.gnss_reception import REACQUIRE_S
from fti.hil.tables.fault_types import GnssOutage
from fti.messages.measurements import DeviceStatus, Measurement, Position, Pseudoranges, Reading, Satellites, Velocity
from tests.hil.worlds import world

M = TypeVar("M")
START_NS = 1_700_000_000_000_000_000
FROM_S, TO_S, DURATION_S = 8.0, 14.0, 24.0
DRIVERS = ("nmea0183", "ublox_ubx", "novatel_oem6", "mavlink", "imar_ixcom", "arinc429")
RATES_HZ = {"mavlink": 25}  # each fifth sample has a position
OPTIONS: dict[str, dict[str, Any]] = {
    "arinc429": {"set": "gnss_743a"},
    "imar_ixcom": {"logs": {"GNSSSOL": 0}},
    "novatel_oem6": {"unasked": True},
}


class Sample(NamedTuple):
    """One sample: its time [s], its messages on the line, and the measurements that the driver decodes."""

    t: float
    messages: list[bytes]
    found: list[Measurement]


@cache
def environment() -> Environment:
    return world(duration_s=DURATION_S, fault=(GnssOutage(kind="gnss_outage", from_s=FROM_S, to_s=TO_S),))


@cache
def samples(driver: str) -> list[Sample]:
    device = Device.model_validate(
        {"name": "device", "link": "line", "driver": driver, "rate_hz": RATES_HZ.get(driver, 5)}
    )
    module = drivers.load(driver)
    bound = BoundDevice(device, module, config.bind(module.Options, OPTIONS.get(driver, {}), "test"))
    made, decoder = SimulatedSensor(bound, MODELS[driver], environment(), seed=1), module.make_decoder(bound.options)
    found = []
    for k, t in enumerate(made.t):
        messages = [message for m in made.measure(k, START_NS) for message in made.encoder.encode(m)]
        read = [m for message in messages for m in decoder.feed(message, START_NS + round(t * 1e9))]
        found.append(Sample(float(t), messages, read))
    return found


def during(driver: str) -> list[Sample]:
    return [s for s in samples(driver) if FROM_S <= s.t < TO_S]


def outside(driver: str) -> list[Sample]:
    return [s for s in samples(driver) if 1.0 < s.t < FROM_S or s.t > TO_S + REACQUIRE_S]


def stream(results: list[Sample]) -> bytes:
    return b"".join(message for sample in results for message in sample.messages)


def of(results: list[Sample], kind: type[M]) -> list[M]:
    return [m for sample in results for m in sample.found if isinstance(m, kind)]


@pytest.mark.parametrize("driver", DRIVERS)
def test_the_position_is_there_before_and_after_and_not_valid_between(driver: str) -> None:
    places, velocities = of(outside(driver), Position), of(outside(driver), Velocity)
    assert min(len(places), len(velocities)) > 20
    assert all(m.valid for m in places)
    assert all(m.valid for m in velocities)
    assert not any(m.valid for m in of(during(driver), Position))
    assert not any(m.valid for m in of(during(driver), Velocity))


@pytest.mark.parametrize("driver", ["nmea0183", "ublox_ubx", "novatel_oem6", "mavlink", "imar_ixcom"])
def test_no_satellite_is_used_and_there_is_no_dilution(driver: str) -> None:
    lost = [m for m in of(during(driver), Satellites) if m.used is not None]
    good = [m for m in of(outside(driver), Satellites) if m.used is not None]
    assert len(lost) >= 25
    assert {m.used for m in lost} == {0}
    assert {(m.hdop, m.vdop, m.pdop) for m in lost} == {(None, None, None)}
    assert all((m.used or 0) >= 8 and (m.hdop or m.pdop or 0.0) > 0.3 for m in good)


@pytest.mark.parametrize(
    ("driver", "flag"),
    [
        ("nmea0183", "no_fix"),
        ("ublox_ubx", "no_fix"),
        ("mavlink", "no_fix"),
        ("novatel_oem6", "position_invalid"),
        ("arinc429", "latitude_no_computed_data"),
        ("imar_ixcom", "gnss_solution_insufficient_obs"),
    ],
)
def test_the_status_says_so(driver: str, flag: str) -> None:
    assert sum(flag in m.flags for m in of(during(driver), DeviceStatus)) >= 25
    assert not any(flag in m.flags for m in of(outside(driver), DeviceStatus))


@pytest.mark.parametrize("driver", ["nmea0183", "ublox_ubx", "novatel_oem6", "mavlink"])
def test_times_go_on(driver: str) -> None:
    times = [max(m.stamp.t_dev_ns or 0 for m in s.found) for s in during(driver) if s.found]
    np.testing.assert_allclose(np.diff(times), 1e9 / RATES_HZ.get(driver, 5), rtol=0.02)


@pytest.mark.parametrize("driver", ["ublox_ubx", "novatel_oem6"])
def test_nothing_is_observed_and_the_sky_is_still_known(driver: str) -> None:
    assert all(not m.observations for m in of(during(driver), Pseudoranges))
    assert all(len(m.observations) >= 8 for m in of(outside(driver), Pseudoranges))
    skies = [m for m in of(during(driver), Satellites) if m.satellites]
    assert skies
    assert not any(s.used or s.cn0_dbhz for m in skies for s in m.satellites)


def test_a_unit_on_arinc_429_computes_neither_dilution_nor_limits() -> None:
    def readings(results: list[Sample], name: str) -> list[Reading]:
        return [m for m in of(results, Reading) if m.name == name]

    for name in ("hdop", "vdop", "horizontal_integrity_limit", "vertical_integrity_limit"):
        assert readings(during("arinc429"), name)
        assert not any(m.valid for m in readings(during("arinc429"), name))
        assert all(m.valid for m in readings(outside("arinc429"), name))
    assert {m.value for m in readings(during("arinc429"), "satellites_used")} == {0.0}
    assert {m.value for m in readings(during("arinc429"), "gnss_mode")} == {8.0}
    assert {m.value for m in readings(outside("arinc429"), "gnss_mode")} == {12.0}


# ------------------------------------------------------------------------------------------------- others' decoders


def test_pynmeagps_reads_quality_0_and_status_v() -> None:
    for found, quality, status in ((during("nmea0183"), 0, "V"), (outside("nmea0183"), 1, "A")):
        data = stream(found)
        parsed = [p for _, p in pynmeagps.NMEAReader(io.BytesIO(data), quitonerror=2) if p is not None]
        fixes = [p for p in parsed if p.msgID == "GGA"]
        assert {p.quality for p in fixes} == {quality}
        assert {p.status for p in parsed if p.msgID == "RMC"} == {status}
        assert all((p.numSV == 0) == (quality == 0) for p in fixes)
        assert all((p.HDOP > 99) == (quality == 0) for p in fixes)
        assert all((p.lat == "") == (quality == 0) for p in fixes)
        assert any(p.msgID == "GST" for p in parsed) == (quality == 1)


def test_pyubx2_reads_no_fix() -> None:
    for found, kind in ((during("ublox_ubx"), 0), (outside("ublox_ubx"), 3)):
        data = stream(found)
        parsed = [p for _, p in UBXReader(io.BytesIO(data), protfilter=2, quitonerror=2)]
        solutions = [p for p in parsed if p.identity == "NAV-PVT"]
        assert {(p.fixType, p.gnssFixOk, p.invalidLlh) for p in solutions} == {(kind, int(kind == 3), int(kind == 0))}
        assert all((p.numSV == 0) == (kind == 0) for p in solutions)
        assert all((p.pDOP == pytest.approx(99.99)) == (kind == 0) for p in solutions)
        assert {p.validTime for p in solutions} == {1}


def test_the_makers_package_reads_insufficient_observations() -> None:
    decoder = oem.Decoder()
    for found, status in ((during("novatel_oem6"), "INSUFFICIENT_OBS"), (outside("novatel_oem6"), "SOL_COMPUTED")):
        frames = [message for sample in found for message in sample.messages]
        logs = [decoder.decode(frame) for frame in frames if int.from_bytes(frame[4:6], "little") == BESTPOS]
        assert len(logs) > 25
        assert {m.solution_status.name for m in logs} == {status}


def test_a_position_says_how_good_it_is_where_the_protocol_can() -> None:
    for driver in ("nmea0183", "ublox_ubx", "novatel_oem6", "mavlink", "imar_ixcom"):
        stated = [m.vertical_sd for m in of(outside(driver), Position) if m.vertical_sd is not None]
        assert stated, driver
        assert all(1.0 < sd < 8.0 for sd in stated if math.isfinite(sd)), driver

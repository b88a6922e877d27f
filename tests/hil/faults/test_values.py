"""Faults of measured values: the changed measurements."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter

from fti.hil.faults.values import DeviceFaults
from fti.hil.tables.fault_types import Fault, Invalid, Stuck
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    DeviceStatus,
    DmeRange,
    ImuSample,
    Measurement,
    RadioHeight,
    Range,
    Reading,
    Stamp,
    SurfaceDeflection,
)

MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
EVER = {"from_s": 0.0, "to_s": 99.0}


def sample(t: float) -> list[Measurement]:
    stamp = Stamp(round(t * 1e9))
    return [
        DeviceStatus(stamp=stamp, ok=True, flags=("in_air",)),
        RadioHeight(stamp=stamp, height_agl=100.0 - t),
        ImuSample(stamp=stamp, gyro_b=(t, 0.0, 0.0)),
    ]


def applied(fault: Fault, device: str, t: float) -> list[Measurement]:
    return DeviceFaults(device, [fault]).apply(t, sample(t))


def test_a_fault_is_of_the_named_device_in_the_interval() -> None:
    fault = Invalid(kind="invalid", devices=("a",), from_s=10.0, to_s=20.0)
    assert applied(fault, "a", 9.99) == sample(9.99)
    assert applied(fault, "a", 10.0) != sample(10.0)
    assert applied(fault, "a", 20.0) == sample(20.0)
    assert applied(fault, "b", 15.0) == sample(15.0)


def test_no_name_means_every_device() -> None:
    assert applied(Invalid(kind="invalid", from_s=0.0, to_s=9.0), "anything", 1.0) != sample(1.0)


def test_a_stuck_device_repeats_its_values_with_fresh_times() -> None:
    faults = DeviceFaults("a", [Stuck(kind="stuck", from_s=10.0, to_s=20.0)])
    faults.apply(9.0, sample(9.0))
    first, later = faults.apply(10.5, sample(10.5)), faults.apply(15.0, sample(15.0))
    assert first == sample(10.5)
    assert [m.stamp for m in later] == [m.stamp for m in sample(15.0)]
    assert isinstance(later[1], RadioHeight)
    assert later[1].height_agl == 89.5


def test_a_stuck_device_goes_on_with_everything_that_it_sends_more_seldom() -> None:
    """Cycles differ: an attitude in each, a range in every second one; both stick, and neither falls silent."""
    faults = DeviceFaults("a", [Stuck(kind="stuck", from_s=10.0, to_s=20.0)])

    def cycle(t: float) -> list[Measurement]:
        stamp = Stamp(round(t * 1e9))
        ranges: list[Measurement] = [Range(stamp=stamp, slant_range=t)] if t % 2 == 0 else []
        speeds = [Airspeed(stamp=stamp, cas=t), Airspeed(stamp=stamp, tas=t + 0.5)]
        return [Attitude(stamp=stamp, roll=t), *ranges, *speeds]

    cycles = [faults.apply(t, cycle(t)) for t in (11.0, 12.0, 13.0, 14.0)]
    assert [[type(m) for m in cycle] for cycle in cycles] == [
        [type(m) for m in cycle(t)] for t in (11.0, 12.0, 13.0, 14.0)
    ]
    assert [m.slant_range for cycle in cycles for m in cycle if isinstance(m, Range)] == [12.0, 12.0]
    assert [m.roll for cycle in cycles for m in cycle if isinstance(m, Attitude)] == [11.0] * 4
    assert [(m.cas, m.tas) for m in cycles[3] if isinstance(m, Airspeed)] == [(11.0, None), (None, 11.5)]


def test_an_invalid_device_reports_it_with_the_reason() -> None:
    fault = Invalid(kind="invalid", from_s=0.0, to_s=9.0, flags=("unlocked",))
    status, height, imu = applied(fault, "a", 1.0)
    assert status == DeviceStatus(stamp=status.stamp, ok=False, flags=("in_air", "unlocked"))
    assert isinstance(height, RadioHeight)
    assert (height.valid, height.height_agl) == (False, 99.0)
    assert imu == sample(1.0)[2]


def test_faults_of_the_world_are_not_faults_of_a_device() -> None:
    from fti.hil.tables.fault_types import Obstacle

    obstacle = Obstacle(kind="obstacle", before_threshold_m=3000.0, height_m=150.0)
    assert applied(obstacle, "a", 1.0) == sample(1.0)


# ---------------------------------------------------------------------------------------------------------- numbers


def heights(fault: Fault, times: list[float], seed: int = 0) -> list[float | None]:
    """The reported heights of a constant 100 m."""
    faults = DeviceFaults("a", [fault], seed)
    measurements = [faults.apply(t, [RadioHeight(stamp=Stamp(round(t * 1e9)), height_agl=100.0)]) for t in times]
    return [m.height_agl for cycle in measurements for m in cycle if isinstance(m, RadioHeight)]


HEIGHT = {"quantity": "radio_height.height_agl", "from_s": 10.0, "to_s": 20.0}


def test_a_bias_is_added_and_a_ramp_grows() -> None:
    times = [9.9, 10.0, 15.0, 19.9, 20.0]
    assert heights(MAKE.validate_python({"kind": "bias", **HEIGHT, "value": -7.5}), times) == [
        100,
        92.5,
        92.5,
        92.5,
        100,
    ]
    ramp = heights(MAKE.validate_python({"kind": "ramp", **HEIGHT, "rate": 2.0}), times)
    assert ramp == pytest.approx([100.0, 100.0, 110.0, 119.8, 100.0], abs=1e-9)


def test_a_wrong_unit_multiplies_and_a_forced_number_replaces_the_measured_one() -> None:
    times = [9.9, 15.0, 20.0]
    wrong = heights(MAKE.validate_python({"kind": "wrong_unit", **HEIGHT, "factor": 0.3048}), times)
    assert wrong == [100.0, pytest.approx(30.48, abs=1e-9), 100.0]
    assert heights(MAKE.validate_python({"kind": "forced", **HEIGHT, "value": 3.0}), times) == [100.0, 3.0, 100.0]


def test_noise_has_its_size_and_its_seed() -> None:
    noise = MAKE.validate_python({"kind": "noise", **HEIGHT, "sd": 2.0})
    times = [10.0 + k / 1000 for k in range(2000)]
    errors = np.array(heights(noise, times, seed=1), dtype=float) - 100.0
    assert errors.std() == pytest.approx(2.0, rel=0.06)
    assert abs(errors.mean()) < 0.2
    assert heights(noise, times, seed=1) == heights(noise, times, seed=1)
    assert heights(noise, times, seed=1) != heights(noise, times, seed=2)


def test_only_the_number_that_is_meant_changes() -> None:
    fault = MAKE.validate_python(
        {"kind": "bias", "quantity": "imu_sample.gyro_b_1", "from_s": 0.0, "to_s": 9.0, "value": 0.5}
    )
    status, height, imu = applied(fault, "a", 1.0)
    assert [status, height] == sample(1.0)[:2]
    assert imu == ImuSample(stamp=imu.stamp, gyro_b=(1.0, 0.5, 0.0))


def test_what_is_not_measured_stays_away() -> None:
    fault = MAKE.validate_python({"kind": "forced", "quantity": "range.slant_range", **EVER, "value": 5.0})
    lost = Range(stamp=Stamp(1), slant_range=None, valid=False)
    assert DeviceFaults("a", [fault]).apply(1.0, [lost]) == [lost]
    nothing = ImuSample(stamp=Stamp(1), gyro_b=None)
    fault = MAKE.validate_python({"kind": "bias", "quantity": "imu_sample.gyro_b_0", **EVER, "value": 5.0})
    assert DeviceFaults("a", [fault]).apply(1.0, [nothing]) == [nothing]


def test_a_name_chooses_among_readings_surfaces_and_stations() -> None:
    measurements: list[Measurement] = [
        Reading(stamp=Stamp(1), name="mach", value=0.2),
        Reading(stamp=Stamp(1), name="hdop", value=0.9),
        DmeRange(stamp=Stamp(1), station="dme_1", slant_range=100.0),
        SurfaceDeflection(stamp=Stamp(1), surface="rudder", deflection=0.1, raw=700),
    ]

    def changed(quantity: str, name: str | None) -> list[int]:
        table = {"kind": "bias", "quantity": quantity, "name": name, **EVER, "value": 1.0}
        results = DeviceFaults("a", [MAKE.validate_python(table)]).apply(1.0, measurements)
        return [k for k, (was, now) in enumerate(zip(measurements, results, strict=True)) if was != now]

    assert changed("reading.value", None) == [0, 1]
    assert changed("reading.value", "hdop") == [1]
    assert changed("dme_range.slant_range", "dme_1") == [2]
    assert changed("dme_range.slant_range", "dme_2") == []
    assert changed("surface_deflection.raw", "rudder") == [3]


def test_a_count_stays_whole() -> None:
    fault = MAKE.validate_python({"kind": "bias", "quantity": "surface_deflection.raw", **EVER, "value": 2.6})
    (found,) = DeviceFaults("a", [fault]).apply(
        1.0, [SurfaceDeflection(stamp=Stamp(1), surface="rudder", deflection=None, raw=700)]
    )
    assert isinstance(found, SurfaceDeflection)
    assert found.raw == 703
    assert type(found.raw) is int

"""Faults of devices: what is sent instead."""

from __future__ import annotations

from fti.hil.faults import DeviceFaults
from fti.hil.scenario import Cut, Fault, Invalid, Stuck
from fti.types import DeviceStatus, ImuSample, Measurement, RadioHeight, Stamp


def sample(t: float) -> list[Measurement]:
    stamp = Stamp(round(t * 1e9))
    return [
        DeviceStatus(stamp=stamp, ok=True, flags=("in_air",)),
        RadioHeight(stamp=stamp, height_agl=100.0 - t),
        ImuSample(stamp=stamp, gyro_b=(t, 0.0, 0.0)),
    ]


def applied(fault: Fault, device: str, t: float) -> list[Measurement]:
    return DeviceFaults(device, [fault]).apply(t, sample(t))


def test_a_cut_silences_the_named_device_in_the_interval() -> None:
    cut = Cut(kind="cut", devices=("a",), from_s=10.0, to_s=20.0)
    assert applied(cut, "a", 9.99) == sample(9.99)
    assert applied(cut, "a", 10.0) == []
    assert applied(cut, "a", 20.0) == sample(20.0)
    assert applied(cut, "b", 15.0) == sample(15.0)


def test_no_name_means_every_device() -> None:
    assert applied(Cut(kind="cut", from_s=0.0, to_s=9.0), "anything", 1.0) == []


def test_a_stuck_device_repeats_its_values_with_fresh_times() -> None:
    faults = DeviceFaults("a", [Stuck(kind="stuck", from_s=10.0, to_s=20.0)])
    faults.apply(9.0, sample(9.0))
    first, later = faults.apply(10.5, sample(10.5)), faults.apply(15.0, sample(15.0))
    assert first == sample(10.5)
    assert [m.stamp for m in later] == [m.stamp for m in sample(15.0)]
    assert isinstance(later[1], RadioHeight)
    assert later[1].height_agl == 89.5


def test_an_invalid_device_says_so_and_names_why() -> None:
    fault = Invalid(kind="invalid", from_s=0.0, to_s=9.0, flags=("unlocked",))
    status, height, imu = applied(fault, "a", 1.0)
    assert status == DeviceStatus(stamp=status.stamp, ok=False, flags=("in_air", "unlocked"))
    assert isinstance(height, RadioHeight)
    assert (height.valid, height.height_agl) == (False, 99.0)
    assert imu == sample(1.0)[2]


def test_faults_of_the_world_are_not_faults_of_a_device() -> None:
    from fti.hil.scenario import Obstacle

    obstacle = Obstacle(kind="obstacle", before_threshold_m=3000.0, height_m=150.0)
    assert applied(obstacle, "a", 1.0) == sample(1.0)

"""Faults of devices: what is sent instead."""

from __future__ import annotations

from fti.hil.faults.kinds import Fault, Invalid, Stuck
from fti.hil.faults.values import DeviceFaults
from fti.types import Airspeed, Attitude, DeviceStatus, ImuSample, Measurement, RadioHeight, Range, Stamp


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

    sent = [faults.apply(t, cycle(t)) for t in (11.0, 12.0, 13.0, 14.0)]
    assert [[type(m) for m in cycle] for cycle in sent] == [
        [type(m) for m in cycle(t)] for t in (11.0, 12.0, 13.0, 14.0)
    ]
    assert [m.slant_range for cycle in sent for m in cycle if isinstance(m, Range)] == [12.0, 12.0]
    assert [m.roll for cycle in sent for m in cycle if isinstance(m, Attitude)] == [11.0] * 4
    assert [(m.cas, m.tas) for m in sent[3] if isinstance(m, Airspeed)] == [(11.0, None), (None, 11.5)]


def test_an_invalid_device_says_so_and_names_why() -> None:
    fault = Invalid(kind="invalid", from_s=0.0, to_s=9.0, flags=("unlocked",))
    status, height, imu = applied(fault, "a", 1.0)
    assert status == DeviceStatus(stamp=status.stamp, ok=False, flags=("in_air", "unlocked"))
    assert isinstance(height, RadioHeight)
    assert (height.valid, height.height_agl) == (False, 99.0)
    assert imu == sample(1.0)[2]


def test_faults_of_the_world_are_not_faults_of_a_device() -> None:
    from fti.hil.faults.kinds import Obstacle

    obstacle = Obstacle(kind="obstacle", before_threshold_m=3000.0, height_m=150.0)
    assert applied(obstacle, "a", 1.0) == sample(1.0)

"""Stuck altimeters are refused and healthy ones are not: flights over hills and woods, with the whole beam of a radar.

10 flights, 200 with ``--scale full``.  The sensors are those of ``fti.ranging``, not what navigation predicts with.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from fti.messages.outputs import HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.agreement import AgreementCheck
from tests.nav.altimeter_flights import DEVICES, Flight, S, channel, fly, outputs, stuck

pytestmark = pytest.mark.timeout(3600)
SECONDS, ONSET_S, END_S = 60.0, 30.0, 50.0
MEMORY = {Reason.STUCK, Reason.CHANGE_MISMATCH}


@dataclass
class Measured:
    """Of all flights: delay until any refusal, and until one by the memory [s]; refused share from then on; begins of
    false refusals by (sensor, known), and flight hours of each.
    """

    delay: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in DEVICES})
    memory: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in DEVICES})
    held: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in DEVICES})
    false: dict[tuple[str, str], int] = field(default_factory=dict)
    hours: float = 0.0


def begins(refused: list[bool]) -> int:
    """How often a refusal begins."""
    return sum(now and not before for before, now in zip([False, *refused], refused, strict=False))


def take_stuck(measurement: Measured, flight: Flight, sensor: str) -> None:
    heights = outputs(flight, sensor, known=True, fault=stuck(ONSET_S, END_S))
    after = [(o.t_ns / S - ONSET_S, o) for o in heights if ONSET_S <= o.t_ns / S < END_S]
    measurement.delay[sensor].append(next((t for t, o in after if o.reasons), np.inf))
    memory = next((t for t, o in after if MEMORY & {*o.reasons}), np.inf)
    measurement.memory[sensor].append(memory)
    if memory < END_S - ONSET_S:
        measurement.held[sensor].append(float(np.mean([bool(o.reasons) for t, o in after if t >= memory])))


def take_healthy(measurement: Measured, flight: Flight) -> None:
    """By the memory of each alone, and by both against each other; a sample refused for another reason counts too."""
    for ground in ("known", "unknown"):
        heights = {s: list(outputs(flight, s, known=ground == "known")) for s in DEVICES}
        check = AgreementCheck({s: channel(s, flight, known=False).limits for s in DEVICES})
        refused: dict[str, list[bool]] = {s: [] for s in DEVICES}
        for pair in zip(*heights.values(), strict=True):
            for height in pair:
                refused[height.sensor].append(is_refused(height, check))
        for sensor, flags in refused.items():
            measurement.false[sensor, ground] = measurement.false.get((sensor, ground), 0) + begins(flags)


def is_refused(height: HeightAboveGround, check: AgreementCheck) -> bool:
    return bool(check.update(height)) or not MEMORY.isdisjoint(height.reasons)


@pytest.fixture(scope="module")
def measured(scale: int) -> Measured:
    measurement = Measured()
    for seed in range(10 if scale == 1 else 200):
        hills = fly(1000 + seed, SECONDS, agl=100.0, wooded=seed % 2 == 1)
        for sensor in DEVICES:
            take_stuck(measurement, hills, sensor)
        healthy = fly(
            2000 + seed,
            SECONDS,
            agl=(60.0, 100.0, 200.0, 300.0)[seed % 4],
            relief_sd=(20.0, 10.0, 40.0)[seed % 3],
            wooded=seed // 4 % 2 == 1,
        )
        for flight in (hills, healthy):
            take_healthy(measurement, flight)
            measurement.hours += SECONDS / 3600
    return measurement


@pytest.mark.parametrize("sensor", list(DEVICES))
def test_stuck_for_20_s_above_hills_is_refused_within_3_s(measured: Measured, sensor: str) -> None:
    delay, memory, held = (np.array(x[sensor]) for x in (measured.delay, measured.memory, measured.held))
    print(
        f"{sensor}: refused within 3 s in {100 * np.mean(delay <= 3.0):.1f} % of {len(delay)} flights, by its memory "
        f"{100 * np.mean(memory <= 3.0):.1f} %, median {np.median(memory):.1f} s; "
        f"then refused {100 * held.mean():.1f} %"
    )
    assert np.mean(delay <= 3.0) >= 0.95
    assert np.mean(memory <= 3.0) >= 0.90
    assert held.min() >= 0.99, "as long as it is stuck"


def test_healthy_altimeters_are_refused_once_in_10_flight_hours_at_most(measured: Measured) -> None:
    print(f"false refusals in {measured.hours:.1f} h each: {measured.false}")
    for key, count in measured.false.items():
        assert count <= max(1.0, measured.hours / 10.0), key
    assert sum(measured.false.values()) <= max(1.0, len(measured.false) * measured.hours / 10.0)

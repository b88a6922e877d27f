"""Any value in any field, at any time, in any order: nothing raises, and valid outputs are plausible."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from fti.messages.measurements import Measurement, Stamp
from fti.messages.outputs import Event, Output
from fti.nav.pipeline import Pipeline
from tests.nav.test_inertial_aiding import MS, T0, S, config, level, measurements

STEPS = 400
WILD: tuple[float | None, ...] = (
    math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300, -1e300, 1e12, 1e7, -1e7, 1e-300,
    math.pi, math.pi / 2, -math.pi / 2, 3.0 * math.pi, 1e4, -500.0, None,
)  # fmt: skip
MAX_VALUES = {
    "lat": math.pi / 2, "lon": math.pi, "alt": 1e5, "roll": math.pi + 1e-6, "pitch": math.pi / 2 + 1e-6,
    "vel_north": 2000.0, "vel_east": 2000.0, "vel_down": 2000.0, "height_agl": 1000.0,
}  # fmt: skip


def spoiled(m: Measurement, rng: np.random.Generator) -> Measurement:
    """With one field that is anything."""
    names = [name for name in m.__struct_fields__ if name not in {"stamp", "valid"}]
    name = names[rng.integers(len(names))]
    value: Any = WILD[rng.integers(len(WILD))]
    if isinstance(old := getattr(m, name), tuple):
        value = tuple(value or 0.0 if k == rng.integers(3) else x for k, x in enumerate(old))
    return structs.replace(m, **{name: value})


def check(out: list[Output | Event], t_ns: int) -> int:
    """How many of the outputs are valid."""
    valid = 0
    for o in out:
        if isinstance(o, Event):
            continue
        fields = {name: getattr(o, name) for name in o.__struct_fields__}
        numbers = {name: value for name, value in fields.items() if isinstance(value, float)}
        assert all(map(math.isfinite, numbers.values())), o
        assert all(value >= 0.0 for name, value in numbers.items() if name.endswith("sd")), o
        valid += o.valid
        if o.valid:
            assert o.t_valid_ns is not None and t_ns - 2 * S < o.t_valid_ns <= t_ns + S, o
            assert all(abs(value) <= MAX_VALUES.get(name, math.inf) for name, value in numbers.items()), o
    return valid


@pytest.mark.parametrize("seed", range(4))
def test_anything_in_any_field_late_and_twice(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pipeline, late = Pipeline(config(), None), list[tuple[int, str, Measurement]]()
    pipeline.set_terrain(level() if seed else None)
    rate, valid = (0.003, 0.02, 0.1, 0.3)[seed], 0
    for k in range(STEPS):
        now = T0 + k * 10 * MS
        due = [(device, m) for at, device, m in late if at <= k]
        late = [entry for entry in late if entry[0] > k]
        for device, m in [*measurements(k, gnss=k < 300), *due]:
            if rng.random() < 0.05:
                late.append((k + int(rng.integers(1, 150)), device, m))
                continue
            sent = spoiled(m, rng) if rng.random() < rate else m
            if rng.random() < 0.01:  # a device's clock, which may say any time that has been
                sent = structs.replace(sent, stamp=Stamp(now, t_valid_ns=now - int(10.0 ** rng.uniform(6, 13))))
            for _ in range(1 + (rng.random() < 0.05)):
                valid += check(pipeline.feed(device, sent), now)
        if k % 2:
            valid += check(pipeline.tick(now + MS), now)
    assert valid > STEPS // 4  # else nothing was asked of it

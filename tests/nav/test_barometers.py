"""Several barometers of ``[nav.filter]``: one aids at a time, each with an offset of its own.

Level flight at a known altitude; the offsets of the barometers are stated here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fti.config import Config, parse
from fti.errors import ConfigError
from fti.messages.measurements import Measurement, PressureAltitude, Stamp
from fti.messages.outputs import FilterSolution
from fti.nav.pipeline import Pipeline
from tests.nav.test_inertial_aiding import ALT, MS, T0, measurements

OFFSETS = {"first": 40.0, "second": -25.0}


def config(baro: Any) -> Config:
    device = {"link": "l", "driver": "d", "max_age_ms": 500.0}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, **device} for name in ("imu", "gnss", "first", "second")],
        "nav": {
            "attitude": ["imu"], "position": ["gnss"], "filter": {"imu": "imu", "gnss": ["gnss"], "baro": baro}
        },
    }  # fmt: skip
    return parse(table, "", Path("t.toml"))


def fly(baro: Any, seconds: float, silent: dict[str, tuple[float, float]]) -> list[FilterSolution]:
    """Level flight; silent : start and end of the silence of a device [s]."""

    def is_received(name: str, t: float) -> bool:
        begin, end = silent.get(name, (0.0, 0.0))
        return not begin <= t < end

    pipeline, out = Pipeline(config(baro), None), list[FilterSolution]()
    for k in range(round(100 * seconds)):
        t, t_ns = 0.01 * k, T0 + k * 10 * MS
        rows: list[tuple[str, Measurement]] = [m for m in measurements(k, gnss=True) if m[0] in ("imu", "gnss")]
        if k % 50 == 0:
            rows += [(name, PressureAltitude(stamp=Stamp(t_ns), alt_press=ALT + up)) for name, up in OFFSETS.items()]
        for device, m in rows:
            if is_received(device, t):
                pipeline.feed(device, m)
        if k % 2 == 0:
            out += [o for o in pipeline.tick(t_ns) if isinstance(o, FilterSolution)]
    return out


def worst(solutions: list[FilterSolution], from_s: float) -> float:
    """Largest error of the altitude from a time on [m]."""
    return max(abs(o.alt - ALT) for o in solutions if o.alt is not None and o.t_ns >= T0 + from_s * 1e9)


def test_another_barometer_takes_over_with_an_offset_of_its_own() -> None:
    """Without satellites from 60 s on, the first barometer silent from 20 to 90 s: altitudes do not follow 65 m."""
    solutions = fly(["first", "second"], 120.0, {"first": (20.0, 90.0), "gnss": (60.0, 999.0)})
    assert worst(solutions, 5.0) < 4.0
    last = solutions[-1]
    assert last.vertical_sd is not None
    assert last.vertical_sd < 12.0
    assert not any("second.altitude" in o.rejected or "first.altitude" in o.rejected for o in solutions)


def test_the_second_one_does_not_aid_while_the_first_one_is_received() -> None:
    both = fly(["first", "second"], 30.0, {})
    alone = fly("first", 30.0, {})
    assert [o.alt for o in both] == [o.alt for o in alone]


def test_a_barometer_that_is_no_device_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"nav\.filter\.baro: unknown device 'third'; configured:"):
        config(["first", "third"])

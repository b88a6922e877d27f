"""The table of a scenario, and what is wrong in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti.errors import ConfigError
from fti.hil import scenario as scenarios
from fti.hil.tables.jsbsim_options import JsbsimFlight

HEADER = 'title = "t"\ndescription = ""\nconfig = "demo.toml"\n[flight]\nkind = "jsbsim"\n'
SHIPPED = ("jsbsim_approach", "jsbsim_go_around", "jsbsim_low_level", "jsbsim_pattern")


@pytest.mark.parametrize(
    ("keys", "error"),
    [
        ('route = "approach"\naircraft = "a380"', r"flight\.aircraft.*c310"),
        ('route = "loop"', r"flight\.route.*low_level"),
        ('route = "approach"\nspeed_mps = 30', r"flight\.speed_mps.*48"),
        ('route = "approach"\nclearance_m = 100', "clearance_m is not allowed on the route 'approach'"),
        ('route = "pattern"\nspeed_mps = 70', "speed_mps = 70.*with gear and flaps down.*65"),
        ('route = "low_level"', "at least two points in via_m"),
        ('route = "low_level"\nvia_m = [[0, 0], [0, 20000]]', r"flight\.via_m.*9000"),
        ('route = "approach"\nturbulence = "extreme"', r"flight\.turbulence.*severe"),
        ('route = "approach"\nwind = 3', r"flight\.wind"),
    ],
)
def test_what_is_wrong_in_the_table_is_named(tmp_path: Path, keys: str, error: str) -> None:
    file = tmp_path / "s.toml"
    file.write_text(HEADER + keys)
    with pytest.raises(ConfigError, match=error):
        scenarios.load(file)


def test_each_route_is_shipped_as_a_scenario() -> None:
    for name in SHIPPED:
        flight = scenarios.load(scenarios.find(name)).flight
        assert isinstance(flight, JsbsimFlight)
        assert f"jsbsim_{flight.route}" == name

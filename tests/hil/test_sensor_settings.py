"""``[sensor.NAME]``: a device takes its model's settings, and says which when it is given others."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti.config import Config
from fti.errors import ConfigError
from fti.hil.scenario import load_config
from fti.hil.sensors import SETTINGS, make_sensors
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from tests.hil.worlds import scenario, world

CONFIG = """
[session]
name = "bench"
[[link]]
name = "line"
kind = "udp"
bind = "127.0.0.1:0"
[[device]]
name = "receiver"
link = "line"
driver = "nmea0183"
"""


@pytest.fixture
def config(tmp_path: Path) -> Config:
    (tmp_path / "bench.toml").write_text(CONFIG)
    return load_config(scenario(), tmp_path / "bench.toml")


def test_a_setting_that_the_model_does_not_take_is_refused_by_its_key(config: Config) -> None:
    environment = world(1.0, sensor={"receiver": {"grade": "navigation"}})
    with pytest.raises(ConfigError, match=r"sensor\.receiver\.grade: there is no such key; allowed here: .*drift_ppm"):
        make_sensors(config, environment, 1, print)


def test_a_device_that_is_not_there_is_refused(config: Config) -> None:
    with pytest.raises(ConfigError, match=r"sensor: unknown device 'ins'; .* has: receiver"):
        load_config(scenario(sensor={"ins": {}}), Path(config.path))


@pytest.mark.parametrize("driver", sorted(SETTINGS))
def test_every_models_settings_have_defaults_and_the_timing(driver: str) -> None:
    kind = SETTINGS[driver]
    plan = scenario(sensor={"ins": {"shift_ms": 2.0}})
    assert settings_of(kind, plan, "ins").shift_ms == 2.0
    assert settings_of(kind, plan, "other") == kind()
    assert issubclass(kind, DeviceSettings)

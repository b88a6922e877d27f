"""``fti decode`` with driver and options of a device of a configuration."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fti.cli.main import main
from tests.helpers import ROOT

SENSORS = str(ROOT / "configs" / "added_sensors.toml")


@pytest.fixture
def lidar(tmp_path: Path) -> str:
    """1000 cm, strength 1500, 35.5 degC: bytes by hand from the maker's table."""
    file = tmp_path / "lidar.bin"
    file.write_bytes(bytes.fromhex("5959e803dc051c09a3"))
    return str(file)


def test_a_capture_is_decoded_as_a_device_reports(lidar: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", lidar, "--config", SENSORS, "--device", "lidar", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[0]["values"]["slant_range"] == 10.0
    assert [line["values"]["value"] for line in lines[1:3]] == [1500.0, 35.5]
    assert lines[-1]["counters"]["messages"] == {"frame": 1}


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        ((), "--driver: missing; give --driver NAME, or --config CONFIG and --device NAME"),
        (("--device", "lidar"), "--config and --device go together, and without --driver and --option"),
        (("--config", SENSORS), "--config and --device go together"),
        (("--config", SENSORS, "--device", "lidar", "--driver", "mavlink"), "without --driver and --option"),
        (("--config", SENSORS, "--device", "lidar", "--option", "length=8"), "without --driver and --option"),
        (("--config", SENSORS, "--device", "sonar"), "no device 'sonar'; configured: lidar, weather"),
        (("--config", "gone.toml", "--device", "lidar"), "gone.toml: cannot be read"),
    ],
)
def test_what_is_wrong_is_one_sentence(
    lidar: str, args: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["decode", lidar, *args]) == 2
    assert sentence in capsys.readouterr().err

"""Errors of a configuration: all at once, each with its line, and the name of its device or link."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti import config as configuration
from fti.devices import bind_devices
from fti.errors import ConfigError

GOOD = """
[session]
name = "x"

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyUSB0"
baud = 9600

[[link]]
name = "eth"
kind = "udp"
bind = "127.0.0.1:4000"

[[device]]
name = "gnss"
link = "line"
driver = "nmea0183"
[device.altimeter]
kind = "laser"
range_m = [1.0, 90.0]
beam_deg = 1.0

[[device]]
name = "autopilot"
link = "eth"
driver = "mavlink"
options = { system = 1 }

[nav]
attitude = ["autopilot"]
position = ["gnss"]
"""
CASES = {
    "a key of a link": ({"baud =": "bauds ="}, ["link[0].bauds: * did you mean 'baud'? (line 9, link 'line')"]),
    "a missing key": (
        {'port = "/dev/ttyUSB0"\n': ""},
        ["link[0].port: missing; it must be given (line 5, link 'line')"],
    ),
    "an inner table": (
        {"1.0, 90.0": "90.0, 1.0"},
        ["device[0].altimeter.range_m = [90.0, 1.0]: the first must be below the second (line 22, device 'gnss')"],
    ),
    "an option": (
        {"system": "sytem"},
        ["device[1].options.sytem: * did you mean 'system'? (line 29, device 'autopilot')"],
    ),
    "names": (
        {'"eth"\ndriver': '"etch"\ndriver', '["gnss"]': '["gns"]'},
        [
            "device[1].link = 'etch': unknown link; configured: * did you mean 'eth'? (line 27, device 'autopilot')",
            "nav.position: unknown device 'gns'; configured: * (line 33)",
        ],
    ),
    "drivers": (
        {"nmea0183": "nmea", '"mavlink"': '"mav"'},
        [
            "device[0].driver = 'nmea': no driver * (line 19, device 'gnss')",
            "device[1].driver = 'mav': no driver * (line 28, device 'autopilot')",
        ],
    ),
}


@pytest.mark.parametrize(("changes", "expected"), CASES.values(), ids=CASES)
def test_each_error_names_line_and_device(changes: dict[str, str], expected: list[str], tmp_path: Path) -> None:
    text, file = GOOD, tmp_path / "own.toml"
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after, 1)
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        bind_devices(configuration.load(file))
    sentences = str(error.value).removeprefix(f"{file}: ").split(f"; {file}: ")
    assert len(sentences) == len(expected)
    for sentence, pattern in zip(sentences, expected, strict=True):
        begin, _, end = pattern.partition("*")
        assert sentence.startswith(begin), sentence
        assert sentence.endswith(end), sentence


def test_a_good_configuration_has_none(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(GOOD)
    assert len(bind_devices(configuration.load(tmp_path / "own.toml"))) == 2


def test_an_error_of_another_file_stays_as_it_is() -> None:
    with pytest.raises(ConfigError, match=r"^labels\.toml: x: wrong$"), configuration.error_lines("own.toml", GOOD):
        raise ConfigError("labels.toml: x: wrong")

"""Errors of a configuration: all at once, each with its line, and the name of its device or link."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti import config as configuration
from fti.cli.main import main
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
            "nav.position: unknown device 'gns'; configured: * did you mean 'gnss'? (line 33)",
        ],
    ),
    "patterns": (
        {'name = "line"\nkind': 'name = "Line-1"\nkind', "127.0.0.1:4000": "127.0.0.1"},
        [
            "link[0].name = 'Line-1': must be lower-case letters, digits and _, a letter first (line 6, link 'Line-1')",
            "link[1].bind = '127.0.0.1': must be ADDRESS:PORT, such as * (line 14, link 'eth')",
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
    sentences = str(error.value).removeprefix(f"{file}: ").split(f"\n{file}: ")
    assert len(sentences) == len(expected)
    for sentence, pattern in zip(sentences, expected, strict=True):
        begin, _, end = pattern.partition("*")
        assert sentence.startswith(begin), sentence
        assert sentence.endswith(end), sentence


def test_each_mistake_is_a_line_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "own.toml"
    file.write_text(GOOD.replace("baud =", "bauds =").replace("bind =", "binds ="))
    assert main(["check", str(file)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert [line.removeprefix(f"fti: {file}: ").split(": ")[0] for line in lines] == [
        "link[0].bauds",
        "link[1].binds",
    ]


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("[nav]", '[nav]\napproach.profile = "none.csv"', "approach.profile"),
        ("[nav]", '[nav]\nterrain = { files = ["none.tif"], vertical = "egm96" }', "terrain ="),
        ("[nav]", '[nav]\nfilter.imu = "gnss"', "filter.imu"),
        ('name = "eth"', 'peer = "127.0.0.1:99999"\nname = "eth"', "peer ="),
    ],
)
def test_a_missing_or_unfit_file_has_its_line_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, line: str
) -> None:
    file, text = tmp_path / "own.toml", GOOD.replace(old, new)
    file.write_text(text)
    assert main(["check", str(file)]) == 2
    number = next(n for n, each in enumerate(text.splitlines(), 1) if each.startswith(line))
    number -= line == "peer ="  # the link's own line
    assert f"(line {number}" in capsys.readouterr().err


def test_a_good_configuration_has_none(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(GOOD)
    assert len(bind_devices(configuration.load(tmp_path / "own.toml"))) == 2


def test_an_error_of_another_file_stays_as_it_is() -> None:
    with pytest.raises(ConfigError, match=r"^labels\.toml: x: wrong$"), configuration.error_lines("own.toml", GOOD):
        raise ConfigError("labels.toml: x: wrong")

"""``fti check SCENARIO``: what a flight would do, without flying it, and one sentence for what is wrong with it."""

from __future__ import annotations

import builtins
import json
import os
from pathlib import Path
from typing import Any

import pytest

from fti.cli._scenario_view import lines
from fti.cli.main import main
from fti.hil import scenario as scenarios
from tests.helpers import ROOT

HEAD = f'title = "Check"\ndescription = ""\nconfig = "{ROOT}/configs/demo.toml"\n'
CUT = '[[fault]]\nkind = "cut"\ndevices = ["altimeter"]\nfrom_s = 30\nto_s = 36\n'


@pytest.fixture(autouse=True)
def no_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of a laboratory may be opened."""
    monkeypatch.setattr("fti.hil.io_backend.PortBackend.make_endpoint", lambda *_: pytest.fail("a port was made"))
    monkeypatch.setattr("fti.hil.emulator.Emulator.run", lambda *_: pytest.fail("it was flown"))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scenario.toml"


def checked(file: object, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    assert main(["check", str(file), "--json", *options]) == 0
    content: dict[str, Any] = json.loads(capsys.readouterr().out)
    return content


@pytest.mark.parametrize(
    "name",
    [
        "fallbacks",
        "gauntlet_serial",
        "gauntlet_slcan",
        "gnss_offset",
        "jsbsim_approach",
        "obstacle",
        "recorded",
        "table",
    ],
)
def test_a_shipped_scenario_is_good(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    content = checked(name, capsys)
    scenario = scenarios.load(scenarios.find(name))
    assert content["title"] == scenario.title
    assert [(row["kind"], row["fault"]) for row in content["faults"]] == [
        (fault.kind, i) for i, fault in enumerate(scenario.fault)
    ]
    assert all(row["subjects"] for row in content["faults"])
    assert all(bool(s["flags"]) is not bool(s["no_flag"]) for row in content["faults"] for s in row["subjects"])
    assert len(content["expect"]) == len(scenario.expect)


def test_a_flag_has_the_limits_that_documents_state(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Silence of a device alone on its link: 1 s, and the cycle of health, 2.5 s; a height is stale after
    max_age_ms of the configuration (500 ms), a cycle of navigation 0.3 s later.
    """
    file.write_text(HEAD + CUT)
    content = checked(file, capsys)
    assert content["scenario"] == str(file)
    assert content["flight"] == {"kind": "approach", "duration_s": 82.0}
    assert content["config"] == f"{ROOT}/configs/demo.toml"
    assert {"name": "gnss", "link": "gnss_line", "driver": "nmea0183", "rate_hz": 5.0} in content["devices"]
    (fault,) = content["faults"]
    assert (fault["kind"], fault["from_s"], fault["to_s"]) == ("cut", 30.0, 36.0)
    (subject,) = fault["subjects"]
    assert subject["subject"] == "altimeter"
    flags = {flag["place"]: flag for flag in subject["flags"]}
    health = flags["/fti/health/devices/altimeter"]
    assert (health["words"], health["from_s"], health["within_s"]) == (["silent", "noise"], 30.0, 3.5)
    height = flags["/nav/height_above_ground/altimeter"]
    assert (height["words"], height["until_s"], height["within_s"]) == (["stale"], 36.0, 0.8)
    assert not any(flag["after_flight"] or flag["needs_ports"] for flag in flags.values())


def test_people_read_the_same(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    expect = '[[expect]]\nchannel = "/nav/nav_solution.valid"\nat_s = 20\nvalue = true\n'
    file.write_text(HEAD + CUT + expect)
    assert main(["check", str(file)]) == 0
    printed = capsys.readouterr()
    shown = printed.out.splitlines()
    assert shown[:3] == [f"{file}: good", "title   Check", "flight  approach, 82 s"]
    assert "  1  cable cut, 30 s to 36 s" in shown
    (stale,) = (line.split() for line in shown if "stale" in line)
    assert " ".join(stale) == (
        "altimeter stale /nav/height_above_ground/altimeter raised from 30.00 s within 0.8 s "
        "cleared from 36.00 s within 1.38 s"
    )
    (value,) = (line.split() for line in shown if "nav_solution.valid" in line)
    assert value == ["/nav/nav_solution.valid", "=", "true", "from", "20", "s", "within", "1", "s"]
    assert "sensor altimeter\n" in printed.err  # progress


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ('kind = "cut"\ndevices = ["pdu"]\nfrom_s = 30\nto_s = 32', "lasts 2 s; silent or noise at "),
        ('kind = "clock_drift"\ndevices = ["ins"]\nppm = 5\nfrom_s = 30\nto_s = 32', "slow drift"),
        ('kind = "brown_out"\ndevices = ["ins"]\nsupply_v = 20\nfrom_s = 30\nto_s = 32', "works at this voltage"),
        ('kind = "fog"\ndevices = ["altimeter"]\nvisibility_m = 9\nfrom_s = 3\nto_s = 9', "is not a laser altimeter"),
        ('kind = "obstacle"\nbefore_threshold_m = 600\nright_m = 90\nheight_m = 60', "off the track"),
    ],
)
def test_a_fault_that_raises_nothing_has_a_reason(
    file: Path, capsys: pytest.CaptureFixture[str], fault: str, reason: str
) -> None:
    file.write_text(f"{HEAD}[[fault]]\n{fault}\n")
    content = checked(file, capsys)
    (subject,) = content["faults"][0]["subjects"]
    assert subject["flags"] == []
    assert reason in subject["no_flag"]
    assert f"no flag is expected:  {subject['no_flag']}" in "\n".join(lines(content))


def test_who_takes_over_belongs_to_the_fault_that_takes_the_last_device(capsys: pytest.CaptureFixture[str]) -> None:
    subjects = [s for row in checked("fallbacks", capsys)["faults"] for s in row["subjects"]]
    words = {word for s in subjects if s["subject"] == "navigation" for flag in s["flags"] for word in flag["words"]}
    assert {"position from filter", "position from radio"} <= words


def test_a_fault_behind_the_end_is_a_warning(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.write_text(HEAD + CUT.replace("30", "90").replace("36", "99"))
    assert main(["check", str(file), "--json"]) == 0
    streams = capsys.readouterr()
    assert "fault[0]" not in streams.err
    content = json.loads(streams.out)
    assert ["the flight ends at 82 s" in warning for warning in content["warnings"]] == [True]
    assert all(flag["after_flight"] for flag in content["faults"][0]["subjects"][0]["flags"])
    printed = "\n".join(lines(content))
    assert ": good, 1 warning\n" in printed
    assert printed.splitlines()[-1].startswith("warning: fault[0], cable cut, begins at 90 s")
    assert "after the end of the flight" in printed


def test_why_a_stuck_device_raises_no_flag(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stuck = CUT.replace('"cut"', '"stuck"')
    file.write_text(HEAD + stuck.replace('"altimeter"', '"gnss", "air_data"'))
    subjects = {s["subject"]: s["no_flag"] for s in checked(file, capsys)["faults"][0]["subjects"]}
    assert "refuses its position if it repeats in motion" in subjects["gnss"]
    assert subjects["air_data"].startswith("only a repeated position")


def test_a_line_that_is_too_slow_is_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "slow.toml"
    config.write_text((ROOT / "configs/demo.toml").read_text().replace("baud = 38400", "baud = 1200"))
    slow, missing = checked("nominal", capsys, "--config", str(config))["warnings"]
    assert slow.startswith("gnss_line: 1200 baud carry 120 bytes a second")
    assert "nav.approach.profile" in missing  # of the daemon; the emulator does not need it


WAYPOINTS = "".join(
    f"[[flight.waypoint]]\nlat_deg = {lat}\nlon_deg = -84.16\nalt_m = {alt}\nspeed_mps = 55\n"
    for lat, alt in ((36.60, 700), (36.63, 0))
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sed = 1", "sed: there is no such key; allowed here: air, airfield, "),
        ('[[fault]]\nkind = "cuts"', "fault[0]"),
        (CUT.replace("altimeter", "laser"), "fault[0].devices: unknown device 'laser'; "),
        (CUT.replace("to_s = 36", "to_s = 6"), "fault[0].to_s = 6.0: must be after from_s = 30.0"),
        (CUT.replace("cut", "gnss_outages"), "fault[0]"),
        (CUT.replace('"cut"', '"clock_jump"\nby_s = 2'), "does not send its time; allowed: arinc429, "),
        (CUT.replace('"cut"', '"wrong_label"'), "freeflight_ra4500 has no message identifier"),
        (
            CUT.replace('"cut"', '"bias"\nquantity = "attitude.roll"\nvalue = 1'),
            "fault[0].quantity: 'altimeter' does not measure attitude.roll; it has radio_height.height_agl",
        ),
        (CUT.replace('"cut"', '"breaker"').replace("altimeter", "pdu"), "'pdu' is a power unit: it feeds itself"),
        ('[[fault]]\nkind = "obstacle"\nbefore_threshold_m = 90000\nheight_m = 9', "is outside the terrain"),
        ("[sensor.altimeter]\ngrade = 1", "sensor.altimeter.grade: there is no such key; allowed here: "),
        ('[port.gnss_line]\nchannel = "vcan0"', "port.gnss_line"),
        ('[port.nothing]\ndevice = "/dev/ttyS9"', "port: unknown link 'nothing'; "),
        ('profile = "none.csv"', "none.csv: cannot be read: No such file"),
        ('[flight]\nkind = "recorded"\nfile = "none.csv"', "none.csv: cannot be read: No such file"),
        ('[flight]\nkind = "recorded"\nfile = "."', "holds no MCAP files"),
        (f'[flight]\nkind = "waypoints"\n{WAYPOINTS}', "m below the ground at "),
        ('[[expect]]\nchannel = "/nav/nav_solution.speed"\nat_s = 1\nvalue = 1', "unknown field 'speed'"),
        ("[session]", "session: there is no such key"),
    ],
)
def test_a_mistake_is_the_sentence_with_which_the_flight_would_be_refused(
    file: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    file.write_text(HEAD + text)
    assert main(["check", str(file)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    *_, sentence = printed.err.splitlines()
    assert sentence.startswith("fti: ")
    assert message in sentence
    assert main(["hil", str(file), "--links", str(file.parent / "links")]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == sentence


def test_what_a_profile_contains_is_checked_with_its_line(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.write_text(f'{HEAD}profile = "faults.csv"')
    file.with_name("faults.csv").write_text("time, channel, fault\n3, altimeter, cut\n")
    assert main(["check", str(file)]) == 2
    assert "faults.csv: line 2, fault = 'cut': never ends" in capsys.readouterr().err


def test_a_missing_configuration_is_named(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.write_text(HEAD.replace("demo.toml", "none.toml"))
    assert main(["check", str(file)]) == 2
    assert "configs/none.toml: cannot be read: No such file" in capsys.readouterr().err


def test_missing_flight_dynamics_are_named(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    load = builtins.__import__

    def without_jsbsim(name: str, *args: Any, **keys: Any) -> Any:
        if name == "jsbsim":
            raise ImportError(name)
        return load(name, *args, **keys)

    monkeypatch.setattr(builtins, "__import__", without_jsbsim)
    assert main(["check", "jsbsim_approach"]) == 2
    assert 'need JSBSim: pip install "fti[jsbsim]"' in capsys.readouterr().err


# ------------------------------------------------------------------------------------- a configuration or a scenario


def test_what_is_neither_shows_what_each_has(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for text in ("", "[tool.ruff]\nline-length = 120\n"):
        file.write_text(text)
        assert main(["check", str(file)]) == 2
        message = capsys.readouterr().err
        assert message.startswith(f"fti: {file}: is neither a configuration nor a scenario: ")
        assert "[session]" in message
        assert "[flight]" in message


def test_a_word_that_is_neither_a_file_nor_a_scenario_lists_the_scenarios(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["check", "nomnal"]) == 2
    assert "fti: nomnal: not a file and not a shipped scenario; shipped: altimeter_failure, " in (
        capsys.readouterr().err
    )


def test_a_file_comes_before_a_shipped_scenario_of_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nominal").write_text('[session]\nname = "mine"\n')
    assert checked("nominal", capsys)["session"]["name"] == "mine"


def test_a_file_may_be_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    for text, key in (('[session]\nname = "piped"\n', "session"), (HEAD, "scenario")):
        reading, writing = os.pipe()
        os.write(writing, text.encode())
        os.close(writing)
        try:
            assert key in checked(f"/dev/fd/{reading}", capsys)
        finally:
            os.close(reading)


@pytest.mark.parametrize("options", [("--live",), ("--links", "links")])
def test_what_belongs_to_a_configuration_is_refused_of_a_scenario(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["check", "nominal", *options])
    assert ended.value.code == 2
    message = capsys.readouterr().err
    assert message.startswith("usage: fti check ")
    assert f"error: {options[0]}: only with a configuration; nominal is a scenario" in message


def test_another_configuration_belongs_to_a_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    demo = f"{ROOT}/configs/demo.toml"
    with pytest.raises(SystemExit) as ended:
        main(["check", demo, "--config", demo])
    assert ended.value.code == 2
    assert "error: --config: only with a scenario; " in capsys.readouterr().err


def test_every_promised_output_is_listed_with_its_rate(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "silence", "--json"]) == 0
    outputs = {row["topic"]: row for row in json.loads(capsys.readouterr().out)["outputs"]}
    solution = outputs["/nav/nav_solution"]  # 25 Hz, docs/navigation.md
    assert solution["least_hz"] < 25.0 < solution["most_hz"]
    assert outputs["/ins/imu_sample"]["most_hz"] is None
    assert "altimeter" in outputs["/nav/clearance_integrity"]["devices"]

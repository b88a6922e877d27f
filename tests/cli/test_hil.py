"""``fti hil`` and ``fti replay`` as a user calls them."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fti.cli._emulator_run import claim_ports, run_until_stopped
from fti.cli.hil import FLIGHT_END
from fti.cli.main import main
from fti.errors import MissingError
from fti.hil.report import Rate, TransmissionReport
from fti.hil.tables.fault_types import FaultKind
from fti.latency_histogram import LatencyHistogram
from tests.e2e.harness import FTI, fti, with_free_ports
from tests.helpers import ROOT
from tests.hil.worlds import world

END_S = 60.0


def demo_config(tmp_path: Path) -> Path:
    file = tmp_path / "demo.toml"
    file.write_text(with_free_ports((ROOT / "configs" / "demo.toml").read_text()).partition("[nav.approach]")[0])
    return file


@contextmanager
def command(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([*FTI, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_scenarios_are_listed_name_first() -> None:
    done = fti("hil", "--list")
    assert done.returncode == 0
    names = [line.split()[0] for line in done.stdout.splitlines()]
    assert names == sorted(file.stem for file in (ROOT / "configs" / "scenarios").glob("*.toml"))
    assert {"nominal", "obstacle", "silence", "table"} <= set(names)


def test_a_flight_reports_ready_flies_and_reports(tmp_path: Path) -> None:
    truth = tmp_path / "out" / "truth.mcap"
    done = fti(
        *("hil", "nominal", "--duration", "0.5", "--config", str(demo_config(tmp_path))),
        *("--links", str(tmp_path / "links"), "--truth", str(truth), "--report", str(tmp_path / "report.json")),
    )
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    assert lines[:2] == ["ready", FLIGHT_END]
    assert any(line.startswith("ins_eth") and " bytes" in line for line in lines)
    assert lines[-1].startswith("lateness of ")
    assert "sensor ins" in done.stderr
    assert truth.stat().st_size > 0
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["devices"]["ins"]["asked_hz"] == 100
    assert f"100 Hz requested, {report['devices']['ins']['sent_hz']:.2f} Hz sent" in done.stdout
    assert lines[-1] == f"lateness of {report['lateness']['messages']} messages: " + shown(report["lateness"])


def shown(late: dict[str, float]) -> str:
    return f"p50 {late['p50_ms']:.2f}, p99 {late['p99_ms']:.2f}, max {late['max_ms']:.2f} ms"


@pytest.mark.parametrize(("arguments", "code"), [((), 0), (("--hold",), 1)])
def test_a_rate_that_is_not_held_is_no_failure_unless_it_is_required(
    arguments: tuple[str, ...], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Rate, "is_held", property(lambda rate: rate.name != "ins"))
    monkeypatch.setattr("fti.hil.emulator.make_environment", lambda *_: world(0.5))
    config, links = str(demo_config(tmp_path)), str(tmp_path / "links")
    assert main(["hil", "nominal", "--duration", "0.2", "--config", config, "--links", links, *arguments]) == code


def test_interrupted_it_ends_with_130_and_takes_its_ports_away(tmp_path: Path) -> None:
    links = tmp_path / "links"
    arguments = ("hil", "nominal", "--wait", "--config", str(demo_config(tmp_path)), "--links", str(links))
    with command(*arguments) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        assert (links / "radalt_line").is_char_device()
        process.send_signal(signal.SIGINT)
        assert process.wait(END_S) == 130
    assert not list(links.iterdir())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_each_of_these_signals_ends_a_flight_in_good_order(number: signal.Signals) -> None:
    async def fly(stop: asyncio.Event) -> TransmissionReport:
        os.kill(os.getpid(), number)
        async with asyncio.timeout(END_S):
            await stop.wait()
        return TransmissionReport({}, LatencyHistogram().summary)

    async def run_flight() -> tuple[TransmissionReport, bool]:
        return await run_until_stopped(fly, asyncio.Event())

    _, interrupted = asyncio.run(run_flight())
    assert interrupted


def test_a_second_one_in_the_same_folder_is_reported_and_a_later_one_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with claim_ports(tmp_path / "links"):
        assert not capsys.readouterr().err
        with claim_ports(tmp_path / "links"):
            assert "links: another fti hil or fti replay uses this folder" in capsys.readouterr().err
    with claim_ports(tmp_path / "links"):
        assert not capsys.readouterr().err


def test_ports_that_another_user_can_replace_are_neither_made_nor_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "links"
    folder.mkdir()
    folder.chmod(0o1777)
    message = f"{folder}: other users can write to it (mode 1777); chmod go-w {folder}"
    with pytest.raises(MissingError, match=re.escape(message)), claim_ports(folder):
        pass
    monkeypatch.setattr("fti.service.daemon.serve", lambda *_, **__: pytest.fail("it was started"))
    assert main(["run", str(demo_config(tmp_path)), "--links", str(folder)]) == 2
    assert capsys.readouterr().err == f"fti: {message}\n"


def test_mistakes_are_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, message in (
        (["hil", "nomnal"], "fti: unknown scenario 'nomnal'; allowed: a file, or one of "),
        (["hil"], "fti: SCENARIO: missing; shipped: "),
        (["replay", str(tmp_path / "nothing")], "there is no such session"),
        (
            ["hil", "nominal", "--report", str(tmp_path / "no" / "report.json")],
            "report.json: cannot be written: No such",
        ),
        (["replay", "s", "--report", str(tmp_path / "no" / "report.json")], "report.json: cannot be written: No such"),
    ):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1


# ------------------------------------------------------------------------------------------------- kinds of faults


def test_every_kind_of_fault_is_described(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["hil", "--faults"]) == 0
    lines = capsys.readouterr().out.splitlines()
    heads = [line.partition(":")[0] for line in lines if line and not line.startswith((" ", "Keys", "fti hil"))]
    assert heads == [kind.value for kind in FaultKind]
    words = [line.split() for line in lines]
    assert ["damaged", "bytes", "/fti/health/devices/DEVICE", "if", "DEVICE", "is", "not", "on", "CAN,"] in [
        line[:9] for line in words
    ]
    (supply,) = (" ".join(line) for line in words if line[:1] == ["supply_v"])
    assert supply == "supply_v [V] default 12.0 supply voltage in the interval number >= 0, < 28"
    assert sum(line.split()[:1] == ["from_s"] for line in lines) == 2  # off_track, and once for all others


def test_one_kind_of_fault_is_described_with_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["hil", "--faults", "fog"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("fog: Fog or cloud below the aircraft")
    assert '    [[fault]]\n    kind = "fog"\n    visibility_m = 40.0\n' in printed
    assert "imu_sample" not in printed
    assert main(["hil", "--faults", "ramp"]) == 0
    assert re.search(r"^ +imu_sample +accel_b_0, ", capsys.readouterr().out, re.MULTILINE)


def test_kinds_of_faults_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["hil", "--faults", "--json"]) == 0
    assert [kind["kind"] for kind in json.loads(capsys.readouterr().out)] == [kind.value for kind in FaultKind]
    assert main(["hil", "--faults", "clock_jump", "--json"]) == 0
    (kind,) = json.loads(capsys.readouterr().out)
    assert kind["flags"] == [
        {"place": "/fti/health/devices/DEVICE", "words": ["clock away"], "when": "by_s is 0.1 s or more"},
        {
            "place": "/nav/nav_solution",
            "words": ["position not from DEVICE"],
            "when": "DEVICE is the first of nav.position, and DEVICE sends its own time, and by_s is more than 0.5 s; "
            "within 5 s",
        },
    ]
    assert kind["keys"][0] == {
        "name": "by_s",
        "unit": "s",
        "default": "",
        "limits": "number >= -100000000, <= 100000000",
        "description": "error of the clock, positive: fast",
        "example": "3.0",
        "instead": "",
    }
    assert "freeflight_ra4500" not in kind["drivers"]
    assert "nmea0183" in kind["drivers"]


def test_wrong_calls_about_kinds_of_faults(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["hil", "--faults", "cuts"]) == 2
    assert capsys.readouterr().err.startswith(
        "fti: --faults 'cuts': not a kind of fault; kinds: obstacle, off_track, terrain_shift, cut, "
    )
    with pytest.raises(SystemExit) as ended:
        main(["hil", "nominal", "--json"])
    assert ended.value.code == 2
    assert "--json: only with --faults" in capsys.readouterr().err

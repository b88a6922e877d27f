"""Emulator, recorder and unit under test in real time: the example, biased or interrupted; and calls that are wrong."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fti.logger.reading.recording import Recording
from tests.e2e.harness import fti
from tests.helpers import ROOT, until
from tests.processes import children_of

pytest_plugins = ["pytester"]
pytestmark = [pytest.mark.e2e, pytest.mark.alone]
EXAMPLE = ROOT / "examples" / "flight_computer"
#: Output of the example's computer -> a bias that is beyond its limit, and the test that must fail.
BIASES = {
    "north": ("20", "position-lat"),
    "east": ("-20", "position-lon"),
    "alt": ("20", "position-alt"),
    "vel_n": ("2", "velocity-north"),
    "vel_e": ("-2", "velocity-east"),
    "vel_d": ("2", "velocity-down"),
    "roll": ("0.06", "attitude-roll"),
    "pitch": ("-0.06", "attitude-pitch"),
    "heading": ("0.06", "attitude-heading"),
    "height": ("30", "test_height_above_ground"),
    "dh": ("-12", "test_height_above_glide_path"),
}
OPTIONS = ("-p", "no:dash", "-p", "no:cacheprovider", "-v")
NOT_IN_FOG = ("-k", "not fog")


@pytest.fixture
def example(pytester: pytest.Pytester) -> Path:
    """The example in a folder of its own, with a shorter nominal flight."""
    shutil.copytree(EXAMPLE, pytester.path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    test = pytester.path / "test_flight_computer.py"
    text = test.read_text()
    assert "FLIGHT_S = 25.0" in text
    test.write_text(text.replace("FLIGHT_S = 25.0", "FLIGHT_S = 8.0"))
    return pytester.path


def failed(result: pytest.RunResult) -> set[str]:
    return {
        line.split("FAILED ")[1].split(" ")[0].split("::")[1] for line in result.outlines if line.startswith("FAILED ")
    }


def test_the_example_passes_and_leaves_its_sessions(pytester: pytest.Pytester) -> None:
    found = pytester.runpytest_subprocess(*OPTIONS, "--fti-keep", str(pytester.path / "kept"), str(EXAMPLE))
    found.assert_outcomes(passed=18)
    sessions = sorted((pytester.path / "kept").glob("*/session/*"))
    assert [session.parents[1].name for session in sessions] == ["nominal", "test_fog_is_reported"]
    for session in sessions:
        assert fti("verify", str(session)).returncode == 0
        assert "/computer/position" in fti("info", "-v", str(session)).stdout
        assert len(Recording.open(session).truth_files) == 1


def test_every_biased_output_fails_its_own_test(
    pytester: pytest.Pytester, example: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FLIGHT_COMPUTER_BIAS", ",".join(f"{name}={value}" for name, (value, _) in BIASES.items()))
    found = pytester.runpytest_subprocess(*OPTIONS, *NOT_IN_FOG)
    found.assert_outcomes(failed=len(BIASES), passed=6, deselected=1)


def test_one_biased_output_fails_no_other_test(
    pytester: pytest.Pytester, example: Path, monkeypatch: pytest.MonkeyPatch, scale: int
) -> None:
    """One of them; with ``--scale full`` each."""
    for name, (value, test) in list(BIASES.items())[:: len(BIASES) if scale == 1 else 1]:
        monkeypatch.setenv("FLIGHT_COMPUTER_BIAS", f"{name}={value}")
        found = pytester.runpytest_subprocess(*OPTIONS, *NOT_IN_FOG)
        found.assert_outcomes(failed=1, passed=16, deselected=1)
        (one,) = failed(found)
        assert test in one


def test_ctrl_c_ends_every_program_and_leaves_the_session(pytester: pytest.Pytester, example: Path) -> None:
    command = [sys.executable, "-m", "pytest", *OPTIONS, *NOT_IN_FOG, "--fti-keep", "kept"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=example)
    try:
        truth = example / "kept" / "nominal" / "flight_truth_000.mcap"
        until(lambda: truth.is_file() and truth.stat().st_size > 50_000, what="the flight")
        programs = children_of(process.pid)
        assert len(programs) == 3
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=60)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == pytest.ExitCode.INTERRUPTED, printed
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in programs), what="the end of every program")
    (session,) = (example / "kept" / "nominal" / "session").iterdir()
    assert fti("verify", str(session)).returncode == 0
    assert not truth.exists()


def test_pytest_that_is_killed_leaves_no_program(pytester: pytest.Pytester, example: Path) -> None:
    command = [sys.executable, "-m", "pytest", *OPTIONS, *NOT_IN_FOG, "--fti-keep", "kept"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, cwd=example) as process:
        until(lambda: len(children_of(process.pid)) == 3, what="three programs")
        programs = children_of(process.pid)
        process.kill()
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in programs), what="the end of every program")


def test_a_flight_that_nobody_listens_to_does_not_begin(pytester: pytest.Pytester, example: Path) -> None:
    pytester.makepyfile(
        test_deaf="""
        def test_deaf(fti_emulator):
            fti_emulator.start("nominal", config="sensors.toml")
            fti_emulator.fly(begin_within_s=0.5)
        """
    )
    found = pytester.runpytest_subprocess(*OPTIONS, "test_deaf.py")
    found.assert_outcomes(failed=1)
    found.stdout.fnmatch_lines(
        ["*BenchError: waited 0.5 s for the begin of the flight:*no listener at autopilot_eth (udp, 127.0.0.1:*"]
    )
    found.stdout.fnmatch_lines(["*- emulator (*", "*stdout, the last 1 of 1 lines", "ready"])


WRONG = {
    "no such scenario": (
        'fti_emulator.start("nominell")',
        "*MissingError: unknown scenario 'nominell'; allowed: *nominal*",
    ),
    "no such configuration": (
        'fti_emulator.start("nominal", config="none.toml")',
        "*MissingError: none.toml: cannot be read: No such file or directory",
    ),
    "a configuration that the scenario does not fit": (
        'fti_emulator.start("altimeter_failure", config="sensors.toml")',
        "*ConfigError: *altimeter_failure.toml: fault*unknown device * sensors.toml has: autopilot, gnss",
    ),
    "a driver that there is not": ('fti_recorder.start("wrong.toml")', "*ConfigError: wrong.toml: device?0?.driver*"),
    "not started": ("fti_emulator.fly()", "*BenchError: the emulator was not started: call start(SCENARIO) first"),
}


def test_wrong_calls_are_one_sentence_each(pytester: pytest.Pytester, example: Path) -> None:
    outputs = (example / "outputs.toml").read_text()
    (example / "wrong.toml").write_text(outputs.replace('driver = "mavlink"', 'driver = "mavlinc"'))
    tests = [f"def test_{i}(fti_emulator, fti_recorder):\n    {call}\n" for i, (call, _) in enumerate(WRONG.values())]
    pytester.makepyfile(test_wrong="\n".join(tests))
    found = pytester.runpytest_subprocess(*OPTIONS, "test_wrong.py")
    found.assert_outcomes(failed=len(WRONG))
    for _, printed in WRONG.values():
        found.stdout.fnmatch_lines([f"E {printed}"])


def test_a_unit_that_ends_in_flight_fails_the_test(pytester: pytest.Pytester, example: Path) -> None:
    text = (example / "flight_computer.py").read_text()
    broken = text.replace(
        "if time.monotonic() >= due_s:",
        "if time.monotonic() - self.start_s > 3.0: raise SystemExit(5)\n            if time.monotonic() >= due_s:",
    )
    assert broken != text
    (example / "flight_computer.py").write_text(broken)
    found = pytester.runpytest_subprocess(*OPTIONS, *NOT_IN_FOG, "-x")
    found.assert_outcomes(errors=1, deselected=1)
    found.stdout.fnmatch_lines(
        ["*BenchError: unit under test, python* ended with exit code 5 before the flight was over"]
    )


def test_the_example_is_as_short_as_it_is_documented() -> None:
    assert len((EXAMPLE / "flight_computer.py").read_text().splitlines()) <= 100


SERIAL_OUTPUT = """
[session]
name = "serial"

[[link]]
name = "result_line"
kind = "serial"
port = "/dev/ttyUSB9"

[[device]]
name = "computer"
link = "result_line"
driver = "nmea0183"
"""
#: Sends what it receives: the receiver itself is the unit under test.
FORWARD = """
import sys, serial
with serial.Serial(sys.argv[1], 38400) as gnss, serial.Serial(sys.argv[2], 115200) as out:
    while True:
        out.write(gnss.readline())
"""


def test_results_on_a_serial_line_are_recorded(pytester: pytest.Pytester, example: Path) -> None:
    (example / "serial.toml").write_text(SERIAL_OUTPUT)
    (example / "forward.py").write_text(FORWARD)
    sensors = (example / "sensors.toml").read_text()
    autopilot, rest = sensors.index("[[link]]"), sensors.index('[[link]]\nname = "gnss_line"')
    receiver = sensors.index('[[device]]\nname = "gnss"')
    (example / "gnss.toml").write_text(
        sensors[:autopilot] + sensors[rest : sensors.index("[[device]]")] + sensors[receiver:]
    )
    pytester.makepyfile(
        test_serial="""
        import sys

        def test_serial(fti_emulator, fti_recorder, fti_unit):
            fti_recorder.start("serial.toml")
            fti_emulator.start("nominal", config="gnss.toml", duration_s=4.0)
            fti_unit.start([sys.executable, "forward.py", "{emulator.gnss_line.path}", "{recorder.result_line.path}"])
            position = fti_emulator.fly().topic("/computer/position", from_s=1.0)
            position.assert_rate(8.0, 12.0)  # GGA and RMC
            position.assert_error("lat", 30.0)
        """
    )
    pytester.runpytest_subprocess(*OPTIONS, "test_serial.py").assert_outcomes(passed=1)

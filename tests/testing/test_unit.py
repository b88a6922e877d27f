"""The unit under test as a program: started, waited for, shown, ended; each in a test of a user."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from tests.helpers import until

pytest_plugins = ["pytester"]
PROGRAM = '[sys.executable, "-u", "-c", {code!r}]'
SLEEP = "import time; time.sleep(600)"


def run(pytester: pytest.Pytester, body: str, *arguments: str) -> pytest.RunResult:
    """A user's test file with one test of this body; ``unit`` is the fixture."""
    test = "import signal, sys\nimport pytest\n\ndef test_unit(fti_unit, fti_bench, request):\n"
    pytester.makepyfile(test + textwrap.indent(textwrap.dedent(body), "    "))
    return pytester.runpytest_subprocess("-p", "no:dash", *arguments)


def python(code: str) -> str:
    return PROGRAM.format(code=code)


def test_its_output_is_in_the_report_of_a_failure(pytester: pytest.Pytester) -> None:
    code = "import sys, time; print('up and running'); print('a doubt', file=sys.stderr); time.sleep(600)"
    result = run(pytester, f"fti_unit.start({python(code)}, ready_text='a doubt')\nassert 1 == 2")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*- unit under test, python* -*", "*stdout, the last 1 of 1 lines", "up and running"])
    result.stdout.fnmatch_lines(["*stderr, the last 1 of 1 lines", "a doubt"])


def test_a_test_that_passes_shows_nothing_and_leaves_no_process(pytester: pytest.Pytester) -> None:
    code = "import os, time; print('pid', os.getpid()); time.sleep(600)"
    result = run(
        pytester,
        f"""
        program = fti_unit.start({python(code)}, ready_text="pid")
        assert program.exit_code is None
        open("pid.txt", "w").write(str(program.pid))
        """,
    )
    result.assert_outcomes(passed=1)
    assert "unit under test" not in result.stdout.str()
    pid = int((pytester.path / "pid.txt").read_text())
    until(lambda: not Path(f"/proc/{pid}").exists(), what="its end")


def test_one_that_ends_early_fails_the_test_with_its_last_lines(pytester: pytest.Pytester) -> None:
    code = "print('no such port: 14550'); raise SystemExit(3)"
    result = run(pytester, f"fti_unit.start({python(code)}, ready_text='ready')")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "*BenchError: unit under test, python* ended with exit code 3 before the flight was over",
            "*no such port: 14550",
        ]
    )


def test_one_that_ends_early_is_seen_while_something_else_is_waited_for(pytester: pytest.Pytester) -> None:
    code = "import time; print('ready'); time.sleep(0.3); raise SystemExit(4)"
    result = run(
        pytester,
        f"""
        fti_unit.start({python(code)}, ready_text='ready')
        fti_unit.start({python(SLEEP)}, ready_text='never')
        """,
    )
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*ended with exit code 4 before the flight was over"])


def test_one_that_is_never_ready(pytester: pytest.Pytester) -> None:
    result = run(pytester, f"fti_unit.start({python(SLEEP)}, ready_text='ready', ready_within_s=0.3)")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*BenchError: waited 0.3 s for text 'ready' of unit under test, python*"])


def test_one_that_never_opens_its_port(pytester: pytest.Pytester) -> None:
    result = run(pytester, f"fti_unit.start({python(SLEEP)}, ready_udp_port='14999', ready_within_s=0.3)")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*BenchError: waited 0.3 s for UDP port 14999 of unit under test, python*"])


def test_one_that_opens_its_ports_is_ready(pytester: pytest.Pytester) -> None:
    code = """
import socket, sys, time
udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
udp.bind(("127.0.0.1", int(sys.argv[1])))
time.sleep(0.2)
tcp = socket.create_server(("127.0.0.1", int(sys.argv[2])))
time.sleep(600)
"""
    result = run(
        pytester,
        f"""
        from fti.testing.ports import free_udp_port, is_udp_port_bound
        udp, tcp = free_udp_port(), free_udp_port()
        fti_unit.start([*{python(code)}, str(udp), str(tcp)], ready_udp_port=udp, ready_tcp_port=tcp)
        assert is_udp_port_bound(udp)
        """,
    )
    result.assert_outcomes(passed=1)


def test_one_that_does_not_end_is_killed_and_that_is_reported(pytester: pytest.Pytester) -> None:
    code = "import signal, time; signal.signal(15, signal.SIG_IGN); print('ready'); time.sleep(600)"
    result = run(
        pytester,
        f"""
        program = fti_unit.start({python(code)}, ready_text='ready', end_within_s=0.2)
        request.addfinalizer(lambda: open("pid.txt", "w").write(str(program.pid)))
        """,
    )
    result.assert_outcomes(passed=1, warnings=1)
    result.stdout.fnmatch_lines(
        ["*UnitKilledWarning: unit under test, python* did not end within 0.2 s of SIGTERM; killed"]
    )
    assert not Path(f"/proc/{int((pytester.path / 'pid.txt').read_text())}").exists()


def test_it_is_ended_by_the_signal_that_it_wants_with_its_children(pytester: pytest.Pytester) -> None:
    code = f"""
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", {SLEEP!r}])
print("child", child.pid)
try:
    child.wait()
except KeyboardInterrupt:
    print("interrupted")
"""
    result = run(
        pytester,
        f"""
        program = fti_unit.start({python(code)}, ready_text="child", end_signal=signal.SIGINT)
        fti_unit.end()
        assert (program.exit_code, program.was_killed) == (0, False)
        assert "interrupted" in program.output
        open("pid.txt", "w").write(program.output.split()[1])
        """,
    )
    result.assert_outcomes(passed=1)
    pid = int((pytester.path / "pid.txt").read_text())
    until(lambda: "State:\tZ" in _status(pid) or not _status(pid), what="the end of its child")


def _status(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return ""


def test_arguments_and_environment_have_placeholders(pytester: pytest.Pytester) -> None:
    code = "import os, sys; print('told', sys.argv[1], os.environ['OUT']); import time; time.sleep(600)"
    result = run(
        pytester,
        f"""
        from fti.testing.ports import LinkAddress
        fti_bench.emulator.links = {{"gnss": LinkAddress("gnss", "serial", path="/tmp/links/gnss")}}
        fti_bench.recorder.links = {{"out": LinkAddress("out", "udp", host="127.0.0.1", port=4711)}}
        command = [*{python(code)}, "{{emulator.gnss.path}}"]
        env = {{"OUT": "{{recorder.out.host}}:{{recorder.out.port}}"}}
        program = fti_unit.start(command, env=env, ready_text="told")
        assert "told /tmp/links/gnss 127.0.0.1:4711" in program.output
        """,
    )
    result.assert_outcomes(passed=1)


@pytest.mark.parametrize("wrong", ["{emulator.gnsss.path}", "{emulator}{", "{0}", "{unit.gnss.path}", '{"json": 1}'])
def test_a_wrong_placeholder_names_the_links(pytester: pytest.Pytester, wrong: str) -> None:
    result = run(
        pytester,
        f"""
        from fti.testing.ports import LinkAddress
        fti_bench.emulator.links = {{"gnss": LinkAddress("gnss", "serial", path="/tmp/links/gnss")}}
        fti_unit.start(["sleep", {wrong!r}])
        """,
    )
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*invalid placeholder*; links: emulator.gnss, each*write a brace twice"])


def test_a_program_that_there_is_not(pytester: pytest.Pytester) -> None:
    result = run(pytester, 'fti_unit.start(["/no/such/program"])')
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*BenchError: unit under test, program: /no/such/program: cannot be started: No such file*"]
    )


def test_folders_are_kept_where_it_is_requested(pytester: pytest.Pytester) -> None:
    for _ in range(2):
        run(pytester, f"fti_unit.start({python(SLEEP)})", "--fti-keep", "kept").assert_outcomes(passed=1)
    assert sorted(folder.name for folder in (pytester.path / "kept").iterdir()) == ["test_unit", "test_unit_1"]
    assert (pytester.path / "kept" / "test_unit" / "unit_0_stdout.txt").is_file()


def test_how_many_flights_is_a_number(pytester: pytest.Pytester) -> None:
    result = run(pytester, "pass", "--fti-flights", "0")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--fti-flights: invalid*"])

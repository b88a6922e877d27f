"""The emulator of a bench: ``fti hil`` as a separate program, on ptys and UDP ports of the bench."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fti.testing.errors import BenchError
from fti.testing.ports import LinkAddress, addresses, is_udp_port_bound, on_free_ports, toml_text, write_config
from fti.testing.process import FTI, BenchProcess, quiet_environment
from fti.testing.recorder import Recorder
from fti.testing.workspace import Workspace

if TYPE_CHECKING:
    from fti.config import Config
    from fti.hil.scenario import Scenario
    from fti.hil.tables.fault_types import Fault
    from fti.testing.flight import Flight

TIMEOUT_PREPARE_S = 120.0
TIMEOUT_BEGIN_S = 60.0
#: The emulator writes the truth five times a second: without a row for this time it has stalled.
TIMEOUT_TRUTH_S = 30.0
TIMEOUT_END_S = 20.0
#: The ports close a moment before the emulator ends; a unit under test that ends in between has not ended early [s].
TIMEOUT_AFTER_PORTS_S = 2.0


class Emulator:
    """Flies one scenario.

    links : address of each link, by name; truth : the truth file; scenario : of the flight, None before ``start``
    end_flight : ends every program of the bench
    """

    def __init__(self, workspace: Workspace, recorder: Recorder, end_flight: Callable[[], None]) -> None:
        self._workspace, self._recorder, self._end_flight = workspace, recorder, end_flight
        self.process: BenchProcess | None = None
        self.links: dict[str, LinkAddress] = {}
        self.scenario: Scenario | None = None
        self.truth = workspace.truth

    def start(
        self,
        scenario: str | Path | Scenario,
        *,
        config: str | Path | None = None,
        duration_s: float | None = None,
        wait_for_ports: bool = True,
    ) -> None:
        """Make the ports of a flight.  The flight begins when the unit under test has opened all of them.

        scenario : name of a shipped one (``fti hil --list``), a file, or an object of ``fti.hil.scenario``
        config : of the sensors, instead of the scenario's; its UDP links get free ports of loopback, its serial and
        slcan links ptys
        duration_s : end after so many seconds of the flight; None : at its end
        wait_for_ports : False : the flight begins at once, without readers
        Raises MissingError or ConfigError with one sentence, BenchError when the emulator does not start.
        """
        if self.process:
            raise BenchError("the emulator of this bench was already started: a bench is for one flight")
        from fti.hil import scenario as scenarios

        if isinstance(scenario, str | Path):
            scenario = scenarios.load(scenarios.find(str(scenario)))
        moved = on_free_ports(scenarios.load_config(scenario, None if config is None else Path(config)))
        ptys = self._workspace.folder / "links"
        self.scenario, self.links = scenario, addresses(moved, ptys)
        options = [] if duration_s is None else ["--duration", f"{duration_s}"]
        command = [*self._command(scenario, moved, ptys), *options, *["--wait"] * wait_for_ports]
        self._workspace.take_slot()
        self.process = BenchProcess(
            "emulator", "emulator", command, self._workspace.folder, environment=quiet_environment()
        )
        self._wait_until_ready(self.process)

    def _command(self, scenario: Scenario, config: Config, ptys: Path) -> list[str]:
        """Write the files of the flight, and return the command."""
        folder = self._workspace.folder
        scenario_file, sensors = folder / "scenario.toml", folder / "sensors.toml"
        write_scenario(scenario, scenario_file)
        write_config(config, sensors)
        options = {
            "--config": sensors,
            "--links": ptys,
            "--truth": self.truth,
            "--report": folder / "emulator_report.json",
            "--run-dir": self._recorder.run_dir,
        }
        return [*FTI, "hil", str(scenario_file), *(str(one) for pair in options.items() for one in pair)]

    def _wait_until_ready(self, process: BenchProcess) -> None:
        def is_ready() -> bool:
            if process.exit_code is not None:
                raise BenchError(f"the emulator ended with exit code {process.exit_code}\n{process.last_lines()}")
            return "ready\n" in process.output

        self._workspace.wait_for(is_ready, TIMEOUT_PREPARE_S, lambda: f"the emulator's ports\n{process.last_lines()}")

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults of the scenario, in order."""
        return self.scenario.fault if self.scenario else ()

    def fly(self, *, begin_within_s: float = TIMEOUT_BEGIN_S) -> Flight:
        """Wait for the end of the flight while every program runs, then end the unit under test and the recorder.

        begin_within_s : the unit under test must open every port of the emulator within this time.
        Raises BenchError when the flight does not begin, or a program ends before the flight.
        """
        from fti.testing.flight import Flight

        process = self.process
        if process is None:
            raise BenchError("the emulator was not started: call start(SCENARIO) first")
        self._workspace.wait_for(lambda: self._has_begun(process), begin_within_s, self._begin_failure)
        self._wait_for_end(process)
        self._end_flight()
        return Flight(self._recorder.session, self._recorder.truth_in_session or self.truth, self.faults)

    def _has_begun(self, process: BenchProcess) -> bool:
        if process.exit_code is not None:
            raise BenchError(f"the emulator ended with exit code {process.exit_code}\n{process.last_lines()}")
        from fti.hil.truth_log import TOPIC
        from fti.logger.reading.mcap_file import McapFile

        return self.truth.is_file() and any(item.topic.name == TOPIC for item in McapFile(self.truth).items())

    def _begin_failure(self) -> str:
        missing = [str(link) for link in self.links.values() if link.kind == "udp" and not _has_listener(link)]
        links = f"no listener at {', '.join(missing)}" if missing else ", ".join(map(str, self.links.values()))
        return (
            "the begin of the flight: it begins when the unit under test has opened every link of the emulator "
            f"(start(wait_for_ports=False) does not wait); {links}"
        )

    def _wait_for_end(self, process: BenchProcess) -> None:
        """Raises BenchError when the emulator fails or stalls."""
        size, since = -1, time.monotonic()

        def has_ended() -> bool:
            nonlocal size, since
            now = self.truth.stat().st_size
            if now != size:
                size, since = now, time.monotonic()
            if time.monotonic() - since > TIMEOUT_TRUTH_S:
                raise BenchError(f"the emulator has written no truth for {TIMEOUT_TRUTH_S:g} s\n{process.last_lines()}")
            return process.exit_code is not None

        try:
            self._workspace.wait_for(has_ended, float("inf"), lambda: "the end of the flight")
        except BenchError:
            if process.ends_within(TIMEOUT_AFTER_PORTS_S) != 0:
                raise
        if process.exit_code != 0:
            raise BenchError(f"the emulator ended with exit code {process.exit_code}\n{process.last_lines()}")

    def end(self) -> None:
        """End the flight now."""
        if self.process:
            self.process.end(signal.SIGTERM, TIMEOUT_END_S)


def write_scenario(scenario: Scenario, file: Path) -> None:
    """Write a scenario as TOML; its own faults include those of its profile."""
    table = scenario.model_dump(mode="json", exclude_unset=True, exclude_none=True, exclude={"profile"})
    file.write_text(toml_text(table), encoding="utf-8")


def _has_listener(link: LinkAddress) -> bool:
    return link.port is not None and is_udp_port_bound(link.port)

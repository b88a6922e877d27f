"""Check of a scenario without a flight: everything that ``fti hil`` computes before it opens a port."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fti.config import Config
from fti.devices import bind_devices, parse_reference, read_texts
from fti.errors import MissingError
from fti.hil.emulator import Emulator, make_environment
from fti.hil.io_backend import PortBackend
from fti.hil.line_load import overloads
from fti.hil.oracle.fault_flags import flags_of_scenario
from fti.hil.oracle.flag_definitions import FaultFlags
from fti.hil.oracle.flags_of_kinds import NO_FLAG
from fti.hil.oracle.required_outputs import RequiredOutput, required_outputs
from fti.hil.oracle.roles import AircraftRoles
from fti.hil.oracle.truth_columns import planned_truth
from fti.hil.scenario import Scenario
from fti.hil.sensors.sent_rates import sent_rates
from fti.hil.tables.fault_types import Fault, FaultKind


@dataclass(frozen=True, slots=True)
class ScenarioCheck:
    """Result of the check of a valid scenario.

    duration_s : of the flight [s]
    flags      : expected flags, each with the index of its fault; one fault has one entry for each device or link
    outputs    : topics that the configuration requires
    warnings   : possible mistakes that do not prevent the flight
    """

    scenario: Scenario
    config: Config
    duration_s: float
    flags: tuple[tuple[int, FaultFlags], ...]
    outputs: tuple[RequiredOutput, ...]
    warnings: tuple[str, ...]

    def flags_for(self, index: int) -> Iterator[FaultFlags]:
        """The entries of one fault, in the order of the configuration."""
        return (one for i, one in self.flags if i == index)


def check_scenario(
    scenario: Scenario, config: Config, progress: Callable[[str], None] = lambda _: None
) -> ScenarioCheck:
    """Check a scenario with a configuration that fits it; takes seconds.  progress : called with each step

    Raises ConfigError or MissingError for everything that ``fti hil`` rejects.
    """
    world = make_environment(scenario, progress)
    emulator = Emulator(config, scenario, PortBackend(Path(), 0, scenario.port), world=world)
    emulator.prepare(progress)
    progress("expected flags")
    truth = planned_truth(world, [device for device in config.device if device.altimeter])
    flags = flags_of_scenario(scenario.fault, AircraftRoles(config, bind_devices(config), scenario), truth)
    warnings = [*world.remarks, *overloads(config, emulator.sensors)]
    try:
        reference = parse_reference(config, read_texts(config))
    except MissingError as error:  # the emulator does not need the file of the published approach
        reference = None
        warnings.append(f"{error}: the daemon needs it")
    outputs = required_outputs(config, reference, sent_rates(emulator.sensors))
    return ScenarioCheck(scenario, config, world.duration, tuple(flags), tuple(outputs), tuple(warnings))


def no_flag_reason(fault: Fault, one: FaultFlags) -> str:
    """Why a fault raises no flag on a device or link; "" if it raises one."""
    if one.expected_flags:
        return ""
    if one.too_short:
        first = min(one.too_short, key=lambda flag: flag.within_s)
        return (
            f"lasts {first.until_s - first.from_s:g} s; "
            f"{' or '.join(first.words)} at {first.place} is due after {first.within_s:g} s"
        )
    return one.unknown or NO_FLAG.get(FaultKind(fault.kind), "no output of this configuration depends on it")

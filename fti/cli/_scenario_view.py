"""What ``fti check`` tells of a scenario, as JSON and for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from fti.cli._check_view import table_lines

if TYPE_CHECKING:
    from fti.config import Config
    from fti.hil.oracle.flag_definitions import ExpectedFlag, FaultFlags
    from fti.hil.oracle.required_outputs import RequiredOutput
    from fti.hil.oracle.scenario_check import ScenarioCheck
    from fti.hil.tables.fault_types import Fault


def describe(check: ScenarioCheck) -> dict[str, Any]:
    """A checked scenario in plain JSON types; times in seconds of the flight."""
    scenario = check.scenario
    return {
        "scenario": scenario.where,
        "title": scenario.title,
        "flight": {"kind": scenario.flight.kind, "duration_s": round(check.duration_s, 3)},
        "config": check.config.path,
        "devices": list(_devices(check.config)),
        "faults": [_fault(i, fault, check) for i, fault in enumerate(scenario.fault)],
        "expect": [expectation.model_dump() for expectation in scenario.expect],
        "outputs": [_output(output) for output in check.outputs],
        "limits": scenario.limits.model_dump(),
        "warnings": list(check.warnings),
    }


def _devices(config: Config) -> Iterator[dict[str, Any]]:
    for device in config.device:
        yield {"name": device.name, "link": device.link, "driver": device.driver, "rate_hz": device.rate_hz}


def _fault(index: int, fault: Fault, check: ScenarioCheck) -> dict[str, Any]:
    from fti.hil.faults.descriptions import describe as in_words

    return {
        "fault": index,
        "kind": fault.kind,
        "what": in_words(fault),
        "from_s": getattr(fault, "from_s", None),  # an obstacle is there all the time
        "to_s": getattr(fault, "to_s", None),
        "subjects": [_subject(fault, one, check.duration_s) for one in check.flags_for(index)],
    }


def _subject(fault: Fault, one: FaultFlags, end_s: float) -> dict[str, Any]:
    from fti.hil.oracle.scenario_check import no_flag_reason

    return {
        "subject": one.subject,
        "flags": [_flag(expected_flag, end_s) for expected_flag in one.expected_flags],
        "no_flag": no_flag_reason(fault, one),
    }


def _flag(expected_flag: ExpectedFlag, end_s: float) -> dict[str, Any]:
    """clears_s : None of a number, which need not go; after_flight : it would be due after the end of the flight"""
    return {
        "place": expected_flag.place,
        "words": list(expected_flag.words),
        "value": expected_flag.value,
        "from_s": round(expected_flag.from_s, 3),
        "until_s": round(expected_flag.until_s, 3),
        "within_s": round(expected_flag.within_s, 3),
        "clears_s": None if expected_flag.value is not None else round(expected_flag.clears_s, 3),
        "needs_ports": expected_flag.needs_ports,
        "after_flight": expected_flag.from_s + expected_flag.within_s > end_s,
    }


def _output(output: RequiredOutput) -> dict[str, Any]:
    """most_hz : None where a recording may have any rate above"""
    least, most = output.rate_hz
    return {
        "topic": output.topic,
        "least_hz": round(least, 3),
        "most_hz": round(most, 3) if math.isfinite(most) else None,
        "gap_s": round(output.gap_s, 3),
        "devices": list(output.devices),
    }


# ------------------------------------------------------------------------------------------------------ for people

#: The row of a fault that is on nothing.
NOTHING: tuple[str, ...] = ("nothing in this configuration can have it",)


def lines(found: dict[str, Any]) -> Iterator[str]:
    """The lines of a description as ``describe`` gives it."""
    yield f"{found['scenario']}: good"
    yield f"title   {found['title']}"
    yield f"flight  {found['flight']['kind']}, {found['flight']['duration_s']:g} s"
    yield f"config  {found['config']}"
    for title, section in SECTIONS.items():
        yield title
        yield from section(found)
    for warning in found["warnings"]:
        yield f"warning: {warning}"


def _device_lines(found: dict[str, Any]) -> Iterator[str]:
    rates = (f"{d['rate_hz']:g} Hz" if d["rate_hz"] else "any rate" for d in found["devices"])
    yield from table_lines(
        [(d["name"], f"on {d['link']}", d["driver"], rate) for d, rate in zip(found["devices"], rates, strict=True)]
    )


def _fault_lines(found: dict[str, Any]) -> Iterator[str]:
    if not found["faults"]:
        yield "  none"
    for fault in found["faults"]:
        span = "all the time" if fault["from_s"] is None else f"{fault['from_s']:g} s to {fault['to_s']:g} s"
        yield f"  {fault['fault'] + 1}  {fault['what']}, {span}"
        rows = [row for subject in fault["subjects"] for row in _subject_rows(subject)]
        yield from ("   " + line for line in table_lines(rows or [NOTHING]))


def _subject_rows(subject: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    if subject["no_flag"]:
        yield (subject["subject"], "no flag is expected:", subject["no_flag"], "", "", "")
    for flag in subject["flags"]:
        yield (subject["subject"], *_flag_cells(flag))


def _flag_cells(flag: dict[str, Any]) -> tuple[str, ...]:
    word = " or ".join(flag["words"]) if flag["value"] is None else f"= {flag['value']:g}"
    raised = f"raised from {flag['from_s']:.2f} s within {flag['within_s']:g} s"
    cleared = "" if flag["clears_s"] is None else f"cleared from {flag['until_s']:.2f} s within {flag['clears_s']:g} s"
    notes = ("on real ports only" * flag["needs_ports"], "after the end of the flight" * flag["after_flight"])
    return (word, flag["place"], raised, cleared, ", ".join(filter(None, notes)))


def _expect_lines(found: dict[str, Any]) -> Iterator[str]:
    yield from table_lines([_expect_cells(row) for row in found["expect"]])


def _expect_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    band = f" +{row['plus']:g} -{row['minus']:g}" if row["plus"] or row["minus"] else ""
    value = str(row["value"]).lower() if isinstance(row["value"], bool) else str(row["value"])
    return (row["channel"], f"= {value}{band}", f"from {row['at_s']:g} s", f"within {row['within_s']:g} s")


def _output_lines(found: dict[str, Any]) -> Iterator[str]:
    yield from table_lines([_output_cells(row) for row in found["outputs"]])


def _output_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    most = "or more" if row["most_hz"] is None else f"to {row['most_hz']:g}"
    return (row["topic"], f"{row['least_hz']:g} {most} Hz", f"gaps up to {row['gap_s']:g} s", ", ".join(row["devices"]))


#: What is listed, one heading each, in this order.
SECTIONS: Mapping[str, Callable[[dict[str, Any]], Iterator[str]]] = {
    "devices": _device_lines,
    "faults and the flags that they must raise": _fault_lines,
    "expect": _expect_lines,
    "outputs, while their devices are good": _output_lines,
}

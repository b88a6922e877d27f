"""Output of ``fti check`` for a scenario, as JSON and as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from fti.cli._check_view import table_lines

if TYPE_CHECKING:
    from fti.hil.oracle.flag_definitions import ExpectedFlag, FaultFlags
    from fti.hil.oracle.required_outputs import RequiredOutput
    from fti.hil.oracle.scenario_check import ScenarioCheck
    from fti.hil.tables.fault_types import Fault


def describe(check: ScenarioCheck) -> dict[str, Any]:
    """A checked scenario in plain JSON types; times in seconds of the flight."""
    scenario = check.scenario
    return {
        "scenario": scenario.source_name,
        "title": scenario.title,
        "flight": {"kind": scenario.flight.kind, "duration_s": round(check.duration_s, 3)},
        "config": check.config.path,
        "devices": [d.model_dump(include={"name", "link", "driver", "rate_hz"}) for d in check.config.device],
        "faults": [_fault(i, fault, check) for i, fault in enumerate(scenario.fault)],
        "expect": [expectation.model_dump() for expectation in scenario.expect],
        "outputs": [_output(output) for output in check.outputs],
        "limits": scenario.limits.model_dump(),
        "warnings": list(check.warnings),
    }


def _fault(index: int, fault: Fault, check: ScenarioCheck) -> dict[str, Any]:
    from fti.hil.faults.descriptions import describe as describe_fault

    return {
        "fault": index,
        "kind": fault.kind,
        "what": describe_fault(fault),
        "from_s": getattr(fault, "from_s", None),  # None: an obstacle is always present
        "to_s": getattr(fault, "to_s", None),
        "subjects": [_subject(fault, fault_flags, check.duration_s) for fault_flags in check.flags_for(index)],
    }


def _subject(fault: Fault, fault_flags: FaultFlags, end_s: float) -> dict[str, Any]:
    from fti.hil.oracle.scenario_check import no_flag_reason

    return {
        "subject": fault_flags.subject,
        "flags": [_flag(expected_flag, end_s) for expected_flag in fault_flags.expected_flags],
        "no_flag": no_flag_reason(fault, fault_flags),
    }


def _flag(expected_flag: ExpectedFlag, end_s: float) -> dict[str, Any]:
    """clears_s : None for a number, which need not clear; after_flight : its time limit is after the flight"""
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
    """most_hz : None where the rate has no upper limit"""
    min_hz, max_hz = output.rate_hz
    return {
        "topic": output.topic,
        "least_hz": round(min_hz, 3),
        "most_hz": round(max_hz, 3) if math.isfinite(max_hz) else None,
        "gap_s": round(output.gap_s, 3),
        "devices": list(output.devices),
    }


# ------------------------------------------------------------------------------------------------------------ text

#: The row of a fault that applies to no device and no link.
NOTHING: tuple[str, ...] = ("applies to nothing in this configuration",)


def lines(description: dict[str, Any]) -> Iterator[str]:
    """The lines of a description that ``describe`` returns."""
    count = len(description["warnings"])
    remark = f", {count} {'warning' if count == 1 else 'warnings'}" if count else ""
    yield f"{description['scenario']}: good{remark}"
    yield f"title   {description['title']}"
    yield f"flight  {description['flight']['kind']}, {description['flight']['duration_s']:g} s"
    yield f"config  {description['config']}"
    for title, section in SECTIONS.items():
        yield title
        yield from section(description)
    for warning in description["warnings"]:
        yield f"warning: {warning}"


def _device_lines(description: dict[str, Any]) -> Iterator[str]:
    rates = (f"{d['rate_hz']:g} Hz" if d["rate_hz"] else "any rate" for d in description["devices"])
    yield from table_lines(
        [(d["name"], f"on {d['link']}", d["driver"], hz) for d, hz in zip(description["devices"], rates, strict=True)]
    )


def _fault_lines(description: dict[str, Any]) -> Iterator[str]:
    if not description["faults"]:
        yield "  none"
    for fault in description["faults"]:
        span = "all the time" if fault["from_s"] is None else f"{fault['from_s']:g} s to {fault['to_s']:g} s"
        yield f"  {fault['fault'] + 1}  {fault['what']}, {span}"
        rows: list[tuple[str, ...]] = []
        for subject in fault["subjects"]:
            if subject["no_flag"]:
                rows.append((subject["subject"], "no flag is expected:", subject["no_flag"], "", "", ""))
            rows += [(subject["subject"], *_flag_cells(flag)) for flag in subject["flags"]]
        yield from ("   " + line for line in table_lines(rows or [NOTHING]))


def _flag_cells(flag: dict[str, Any]) -> tuple[str, ...]:
    word = " or ".join(flag["words"]) if flag["value"] is None else f"= {flag['value']:g}"
    raised = f"raised from {flag['from_s']:.2f} s within {flag['within_s']:g} s"
    cleared = "" if flag["clears_s"] is None else f"cleared from {flag['until_s']:.2f} s within {flag['clears_s']:g} s"
    notes = ("on real ports only" * flag["needs_ports"], "after the end of the flight" * flag["after_flight"])
    return (word, flag["place"], raised, cleared, ", ".join(filter(None, notes)))


def _expect_cells(row: dict[str, Any]) -> tuple[str, ...]:
    band = f" +{row['plus']:g} -{row['minus']:g}" if row["plus"] or row["minus"] else ""
    value = str(row["value"]).lower() if isinstance(row["value"], bool) else str(row["value"])
    return (row["channel"], f"= {value}{band}", f"from {row['at_s']:g} s", f"within {row['within_s']:g} s")


def _output_cells(row: dict[str, Any]) -> tuple[str, ...]:
    high = "or more" if row["most_hz"] is None else f"to {row['most_hz']:g}"
    return (row["topic"], f"{row['least_hz']:g} {high} Hz", f"gaps up to {row['gap_s']:g} s", ", ".join(row["devices"]))


#: Headings and their lines, in order.
SECTIONS: Mapping[str, Callable[[dict[str, Any]], Iterator[str]]] = {
    "devices": _device_lines,
    "faults and the flags that they must raise": _fault_lines,
    "expect": lambda description: table_lines([_expect_cells(row) for row in description["expect"]]),
    "outputs, while their devices are good": lambda description: table_lines(
        [_output_cells(row) for row in description["outputs"]]
    ),
}

"""Profile of a scenario: a CSV table of faults and expectations.

Similar to the stimulus profiles of NI VeriStand (manual, "CSV File Formatting for Stimulus Profiles"), which have
``timestamp`` [ms], a column for each stimulated channel, ``#FLT_STATE#`` and ``#FLT_VALUE#`` for a faulted one, and
``#EXP(+tol;-tol;ms delay)#`` for an evaluated one.  There a row is an instant of all channels; here it is one event of
one channel, and times are in seconds.

    time, channel, value, fault, expected, plus, minus, within

    time     [s] of the flight, not descending
    channel  a device or a CAN link; several: "a+b"; "*": every one to which the fault applies
             a number of a device: "altimeter.radio_height.height_agl"; an output: "/nav/glide_slope.dots"

    fault = KIND     start of a fault of a device or a link, with its parameters in ``value``: the default parameter
                     alone ("75"), or by name ("visibility_m=100; echo_m=75|5")
    fault = end      end of the fault; ``value`` is its kind if several are active on the channel
    only value       set point of a number until the next one, or until ``end`` (the kind "forced")
    expected         value of the output: a number with tolerances ``plus`` above and ``minus`` below, true, false or
                     a word, at most ``within`` [s] later (default 1 s)

Numbers are in SI units and radians.  A line that begins with # is a comment.  Every fault must end.  Faults of the
world (obstacle, off_track, terrain_shift) are not allowed here; they belong in the scenario.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

from fti.config import StrictModel
from fti.devices import read_text
from fti.hil.scenario.fault_table_csv import FaultTableRow, rows
from fti.hil.tables.fault_base import LinkFault, QuantityFault
from fti.hil.tables.fault_types import Fault, FaultKind, Obstacle, OffTrack, TerrainShift
from fti.hil.tables.schema import Expectation

END = "end"
ALL_SUBJECTS = "*"
#: Kinds of faults that a row can have, by their names.
KINDS: Mapping[str, type[StrictModel]] = {
    kind: model
    for model in get_args(get_args(Fault)[0])
    if model not in (Obstacle, OffTrack, TerrainShift)
    for kind in get_args(model.model_fields["kind"].annotation)
}
#: The parameter to which a ``value`` without a name belongs.
DEFAULT_PARAMETER = {
    FaultKind.BABBLING: "rate_hz",
    FaultKind.BIAS: "value",
    FaultKind.BIT_ERRORS: "rate",
    FaultKind.BROWN_OUT: "supply_v",
    FaultKind.BURST: "hold_s",
    FaultKind.CAN_STATUS: "flags",
    FaultKind.CLOCK_DRIFT: "ppm",
    FaultKind.CLOCK_JUMP: "by_s",
    FaultKind.DUPLICATED: "share",
    FaultKind.FOG: "visibility_m",
    FaultKind.FORCED: "value",
    FaultKind.INVALID: "flags",
    FaultKind.LATENCY: "by_s",
    FaultKind.LOST_HEADER: "count",
    FaultKind.NOISE: "sd",
    FaultKind.RAMP: "rate",
    FaultKind.REORDERED: "share",
    FaultKind.SCALE: "percent",
    FaultKind.TRUNCATED: "count",
    FaultKind.UNDULATION: "stated",
    FaultKind.WRONG_CHECKSUM: "share",
    FaultKind.WRONG_LABEL: "share",
    FaultKind.WRONG_UNIT: "factor",
}


class FaultTable(NamedTuple):
    """The faults and expectations of a table, as in a scenario."""

    faults: tuple[Fault, ...]
    expectations: tuple[Expectation, ...]


def read(path: Path) -> FaultTable:
    """Read and check a profile.  Raises MissingError, or ConfigError with file, line, column and allowed values."""
    return parse(read_text(path), str(path))


def parse(text: str, file: str) -> FaultTable:
    """Check the text of a profile.  file : its name, for error messages"""
    table = FaultTableBuilder()
    for row in rows(text, file):
        table.add_row(row)
    return table.build()


class OpenFault(NamedTuple):
    """A fault that has not ended yet: its first row, its kind and its table without the end."""

    row: FaultTableRow
    kind: str
    table: dict[str, Any]


class FaultTableBuilder:
    """Collects the faults and expectations of the rows."""

    def __init__(self) -> None:
        self._open_faults: dict[tuple[str, str], OpenFault] = {}  # by channel and kind
        self._faults: list[tuple[int, Fault]] = []  # with the line where each began
        self._expectations: list[Expectation] = []
        self._t = 0.0

    def add_row(self, row: FaultTableRow) -> None:
        """Add a row.  Raises ConfigError."""
        t = row.number("time", -1.0)
        if not self._t <= t < float("inf"):
            raise row.error("time", f"must be a number of seconds, not less than {self._t:g} (the row before)")
        self._t = t
        if row["expected"]:
            self._expect(row, t)
            return
        for column in ("plus", "minus", "within"):
            if row[column]:
                raise row.error(column, "must be empty in a row without expected")
        if row["fault"] == END:
            self._end(row, t)
        elif row["fault"]:
            self._begin(row, row["fault"], t)
        elif row["value"]:
            self._set(row, t)
        else:
            raise row.error(
                "fault", f"is empty, as are value and expected; one is required; kinds: {', '.join(KINDS)}, {END}"
            )

    def build(self) -> FaultTable:
        """The table, with faults in the order in which they began.  Raises ConfigError."""
        for open_fault in self._open_faults.values():
            raise open_fault.row.error("fault", f"never ends; a later row must have fault = {END} on the same channel")
        return FaultTable(
            tuple(fault for _, fault in sorted(self._faults, key=lambda f: f[0])), tuple(self._expectations)
        )

    def _expect(self, row: FaultTableRow, t: float) -> None:
        for column in ("value", "fault"):
            if row[column]:
                raise row.error(column, "must be empty in a row with expected")
        table = {
            "channel": row["channel"],
            "at_s": t,
            "value": _parse_scalar(row["expected"]),
            "plus": row.number("plus", 0.0),
            "minus": row.number("minus", 0.0),
            "within_s": row.number("within", 1.0),
        }
        self._expectations.append(row.bind_model(Expectation, table, "expected"))

    def _begin(self, row: FaultTableRow, kind: str, t: float) -> None:
        if kind not in KINDS:
            raise row.error("fault", f"unknown kind of fault; allowed: {', '.join(KINDS)}, {END}")
        if (row["channel"], kind) in self._open_faults:
            raise row.error("fault", f"is already active on this channel; it must end before ({END})")
        table = {"kind": kind, "from_s": t, **_channel(row, kind), **_parameters(row, kind)}
        self._open_faults[row["channel"], kind] = OpenFault(row, kind, table)

    def _set(self, row: FaultTableRow, t: float) -> None:
        """A set point ends the one before it on the channel."""
        if open_fault := self._open_faults.pop((row["channel"], FaultKind.FORCED), None):
            self._close(open_fault, row, t)
        self._begin(row, FaultKind.FORCED, t)

    def _end(self, row: FaultTableRow, t: float) -> None:
        active = [kind for channel, kind in self._open_faults if channel == row["channel"]]
        if not active:
            raise row.error("channel", "has no active fault that could end")
        if row["value"] and row["value"] not in active:
            raise row.error("value", f"is not active on this channel; active: {', '.join(active)}")
        if not row["value"] and len(active) > 1:
            raise row.error("value", f"must be the kind that ends; active: {', '.join(active)}")
        self._close(self._open_faults.pop((row["channel"], row["value"] or active[0])), row, t)

    def _close(self, open_fault: OpenFault, row: FaultTableRow, t: float) -> None:
        if t <= open_fault.table["from_s"]:
            raise row.error("time", f"must be after {open_fault.table['from_s']:g}, the start of {open_fault.kind}")
        fault = open_fault.row.bind_model(KINDS[open_fault.kind], {**open_fault.table, "to_s": t}, "value")
        self._faults.append((open_fault.row.line, fault))


def _channel(row: FaultTableRow, kind: str) -> dict[str, Any]:
    """The devices or links of a channel, and its quantity."""
    names, _, quantity = row["channel"].partition(".")
    if not names or (issubclass(KINDS[kind], QuantityFault) and not quantity):
        needed = "DEVICE.MEASUREMENT.NUMBER" if issubclass(KINDS[kind], QuantityFault) else "a name, a+b, or *"
        raise row.error("channel", f"{kind} needs {needed}")
    if quantity and not issubclass(KINDS[kind], QuantityFault):
        raise row.error("channel", f"{kind} affects whole devices or links; allowed: a name, a+b, or *")
    key = "links" if issubclass(KINDS[kind], LinkFault) else "devices"
    table: dict[str, Any] = {} if names == ALL_SUBJECTS else {key: tuple(name.strip() for name in names.split("+"))}
    return {**table, "quantity": quantity} if quantity else table


def _parameters(row: FaultTableRow, kind: str) -> dict[str, Any]:
    """The parameters of a fault; the default one needs no name."""
    if not row["value"]:
        return {}
    if "=" not in row["value"]:
        if kind not in DEFAULT_PARAMETER:
            raise row.error("value", f"{kind} has no default parameter; it has: {_parameter_names(kind)}")
        return {
            DEFAULT_PARAMETER[FaultKind(kind)]: _parse_parameter(kind, DEFAULT_PARAMETER[FaultKind(kind)], row["value"])
        }
    found = {}
    for part in row["value"].split(";"):
        name, _, text = (piece.strip() for piece in part.partition("="))
        if name not in _own_parameters(kind):
            raise row.error("value", f"unknown parameter {name!r} of {kind}; allowed: {_parameter_names(kind)}")
        found[name] = _parse_parameter(kind, name, text)
    return found


def _own_parameters(kind: str) -> list[str]:
    """Parameters that no other column has."""
    elsewhere = ("kind", "devices", "links", "from_s", "to_s", "quantity")
    return [name for name in KINDS[kind].model_fields if name not in elsewhere]


def _parameter_names(kind: str) -> str:
    return ", ".join(_own_parameters(kind)) or "none"


def _parse_parameter(kind: str, name: str, text: str) -> Any:
    """Convert text to the type of the parameter: a text, a list separated by |, or a number."""
    annotation = KINDS[kind].model_fields[name].annotation
    hints = (annotation, *get_args(annotation))
    if any(get_origin(hint) is tuple for hint in hints):
        return tuple(_parse_scalar(part.strip()) for part in text.split("|"))
    return text if str in hints else _parse_scalar(text)


def _parse_scalar(text: str) -> bool | int | float | str:
    """A boolean, a number, or the text itself."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text

"""``fti watch --router``: several aircraft through a zenoh router."""

from __future__ import annotations

import argparse
import contextlib
import math
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from fti.cli._printing import print_json
from fti.cli._router_arguments import router_table
from fti.cli._watch_view import (
    ALARM_STYLES,
    INTEGRITY_STYLES,
    STRUCK_OUT,
    UNKNOWN,
    render,
    show_live,
    shown_state,
)
from fti.clock import SystemClock
from fti.errors import MissingError
from fti.ground.fleet import Fleet, summaries
from fti.ground.router_client import RouterClient
from fti.terminal_text import escape_tree

if TYPE_CHECKING:
    from rich.console import RenderableType

#: Time for the first messages, and the longest wait for the first aircraft [s].
COLLECT_S, AIRCRAFT_TIMEOUT_S = 1.2, 10.0
#: An aircraft without a message for so long is silent [ms].
CONTACT_MS = 5000.0
#: Period of the JSON objects [s].
JSON_PERIOD_S = 1.0
COLUMNS = (
    "aircraft",
    "session",
    "last message",
    "position",
    "altitude",
    "height",
    "integrity",
    "glide slope",
    "alarms",
)

States = dict[str, dict[str, Any]]


def watch_fleet(args: argparse.Namespace) -> int:
    """Show the aircraft of a router, or one of them.  Raises MissingError when none sends anything."""
    clock, fleet = SystemClock(0), Fleet(1000.0 * args.max_age)
    with contextlib.closing(RouterClient(router_table(args), fleet, clock)):
        _wait_for(lambda: fleet.states(clock.now_ns()), args)
        if args.json:
            _print_json(lambda: fleet.states(clock.now_ns()), args.once)
        elif args.aircraft:
            show_live(lambda: render(fleet.states(clock.now_ns())[args.aircraft]), args.once)
        else:
            show_live(lambda: render_fleet(fleet.states(clock.now_ns())), args.once)
    return 0


def _wait_for(read: Callable[[], States], args: argparse.Namespace) -> None:
    """Wait for the first messages of any aircraft, or of the requested one."""
    begin_s = time.monotonic()
    while (
        (waited_s := time.monotonic() - begin_s) < COLLECT_S
        or not (names := [*read()])
        or (args.aircraft and args.aircraft not in names)
    ):
        if waited_s > AIRCRAFT_TIMEOUT_S:
            who = args.aircraft or "any aircraft"
            others = f"; others: {', '.join(read())}" if read() else ""
            raise MissingError(f"{args.router}: no message of {who} within {AIRCRAFT_TIMEOUT_S:g} s{others}")
        time.sleep(0.05)


def _print_json(read: Callable[[], States], once: bool) -> None:
    while True:
        states = {name: {**shown_state(state), "session": state["session"]} for name, state in read().items()}
        print_json({"aircraft": states}, indent=None, flush=True)
        if once:
            return
        time.sleep(JSON_PERIOD_S)


def render_fleet(states: States) -> RenderableType:
    """One row for each aircraft."""
    table = Table(*COLUMNS, expand=True, box=None, header_style="dim")
    for row in summaries(escape_tree(states)):
        is_silent = row["contact_ms"] > CONTACT_MS
        table.add_row(*_cells(row), style="red" if is_silent else "")
    return table


def _cells(row: Mapping[str, Any]) -> list[Text]:
    origin = "" if row["origin"] in ("flight", "") else f" {row['origin'].upper()}"
    state = "" if not row["integrity"] or row["integrity"]["late"] else str(row["integrity"]["state"])
    worst = row["worst"]
    more = f" +{row['alarms'] - 1}" if row["alarms"] > 1 else ""
    return [
        Text(f"{row['aircraft']}{origin}", "bold"),
        Text(row["session"]),
        Text(f"{row['contact_ms'] / 1000:.1f} s ago"),
        _value(row["position"], lambda fields: f"{_degrees(fields['lat'], 'NS')} {_degrees(fields['lon'], 'EW')}"),
        _value(row["position"], lambda fields: f"{fields['alt']:.0f} m"),
        _value(row["height"], lambda fields: f"{fields['height_agl']:.1f} m"),
        Text(state.replace("_", " ").upper() or UNKNOWN, INTEGRITY_STYLES.get(state, "")),
        _value(row["glide"], lambda fields: f"{math.degrees(fields['deviation']):+.2f}°"),
        Text(f"{worst['title']}{more}", ALARM_STYLES.get(worst["severity"], "")) if worst else Text("none"),
    ]


def _degrees(angle: float, letters: str) -> str:
    return f"{abs(math.degrees(angle)):.5f}° {letters[angle < 0.0]}"


def _value(output: Mapping[str, Any] | None, text: Callable[[Mapping[str, Any]], str]) -> Text:
    """A value of an output; struck out when it must not be used."""
    try:
        shown = text(output) if output else UNKNOWN
    except (KeyError, TypeError):  # a value is unknown
        shown = UNKNOWN
    return Text(shown, "" if output and output["valid"] and not output["late"] else STRUCK_OUT)

"""The sinks of ``[publish]`` in ``fti watch``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

COLUMNS = ("outputs to", "state", "peers", "sent", "replaced", "lost events", "hint")


def sinks_table(sinks: Mapping[str, Mapping[str, Any]]) -> Iterator[Table]:
    """State, connected peers, and counts of each sink; nothing without sinks."""
    table = Table(*COLUMNS, expand=True, box=None, header_style="dim")
    for name, sink in sinks.items():
        lost = sink["lost_events"]
        table.add_row(
            Text(name, "bold"),
            Text(sink["state"], "green" if sink["state"] == "connected" else "yellow"),
            "" if sink["peers"] is None else str(sink["peers"]),
            f"{sink['sent']:,}",
            f"{sink['replaced']:,}",
            Text(f"{lost:,}", "bold yellow" if lost else ""),
            Text(sink["hint"], "dim"),
        )
    if table.row_count:
        yield table

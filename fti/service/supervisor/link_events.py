"""Events about ports that cannot be opened or were lost, for the terminal and the recorded file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fti.messages.frames import LinkState

#: A state is reported after this time: twice the longest time between two attempts to open a port.
MIN_DURATION_NS = 4_000_000_000
DOWN_STATES = frozenset({LinkState.ABSENT, LinkState.DENIED, LinkState.BUSY})


class LinkEvents:
    """Reports lasting changes of the port states."""

    def __init__(self) -> None:
        self._states: dict[str, tuple[str | None, int]] = {}
        self._reported: dict[str, tuple[str | None, str]] = {}
        self._level = "warning"

    def expect_changes(self, is_expected: bool, now_ns: int) -> None:
        """Set whether ports are absent because the sensors are off: such events have the level info.

        A port that is still absent afterwards is reported after the usual time.
        """
        self._level = "info" if is_expected else "warning"
        self._states = {name: (state, now_ns) for name, (state, _) in self._states.items()}

    def update(self, links: Mapping[str, Mapping[str, Any]], now_ns: int) -> Iterator[tuple[str, str, str]]:
        """Level, source and text of each event that is due.  links : health by name, at now_ns."""
        for name, link in links.items():
            trouble = str(link["state"]) if link["state"] in DOWN_STATES else None
            state, since_ns = self._states.get(name, (None, now_ns))
            if trouble != state:
                since_ns = now_ns
            self._states[name] = trouble, since_ns
            reported, level = self._reported.get(name, (None, self._level))
            is_new = trouble != reported or (trouble and self._level == "warning" != level)
            if not is_new or now_ns - since_ns < MIN_DURATION_NS:
                continue
            self._reported[name] = trouble, self._level
            if trouble:
                yield self._level, name, f"{trouble}: {link['hint']}"
            else:
                yield level, name, "the port is open now"

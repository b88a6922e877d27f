"""Events about ports that cannot be opened or were lost, for the terminal and the recorded file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fti.messages.frames import LinkState

#: A state is reported after this time; a device that is switched on with the computer needs a moment.
MIN_DURATION_NS = 2_000_000_000
DOWN_STATES = frozenset({LinkState.ABSENT, LinkState.DENIED, LinkState.BUSY})


class LinkEvents:
    """Reports lasting changes of the port states."""

    def __init__(self) -> None:
        self._states: dict[str, tuple[str | None, int]] = {}
        self._reported: dict[str, str | None] = {}

    def update(self, links: Mapping[str, Mapping[str, Any]], now_ns: int) -> Iterator[tuple[str, str, str]]:
        """Level, source and text of each event that is due.  links : health by name, at now_ns."""
        for name, link in links.items():
            trouble = str(link["state"]) if link["state"] in DOWN_STATES else None
            state, since_ns = self._states.get(name, (None, now_ns))
            if trouble != state:
                since_ns = now_ns
            self._states[name] = trouble, since_ns
            if trouble == self._reported.get(name) or now_ns - since_ns < MIN_DURATION_NS:
                continue
            self._reported[name] = trouble
            yield "warning", name, f"{trouble}: {link['hint']}" if trouble else "the port is open now"

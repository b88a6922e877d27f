"""Frames of a DBC for the emulator: a message goes out when everything in it has been told anew.

cantools encodes, so what the compiled decoder makes of a frame is judged by another program.
"""

from __future__ import annotations

from collections.abc import Mapping

from fti.canframe import pack_can
from fti.drivers._dbc import Layout, Signal


class FrameBuilder:
    """Builds the frames of one message."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.signals: Mapping[str, Signal] = {s.name: s for s in layout.signals}
        self._raw: dict[str, float] = {}

    def tell(self, name: str, raw: float) -> None:
        """Keep the raw value of a signal for the next frame."""
        self._raw[name] = raw

    def frame(self, own: Mapping[str, float]) -> bytes | None:
        """The frame, when all that is in it has been told.  own : what nobody tells: counter, node."""
        told = {**self._raw, **{name: raw for name, raw in own.items() if name in self.signals}}
        chosen = {s.name: int(told[s.name]) for s in self.layout.selectors if s.name in told}
        present = [s.name for s in self.layout.selected(chosen)]
        if not all(name in told for name in present):
            return None
        self._raw = {}
        return pack(self.layout, {name: told[name] for name in present})


def pack(layout: Layout, raw: Mapping[str, float]) -> bytes:
    """A frame with these raw values; every signal that it needs must be there."""
    data = layout.message.encode(dict(raw), scaling=False, strict=False)
    return pack_can(layout.can_id, data, extended=layout.extended, fd=layout.length > 8)

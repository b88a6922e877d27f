"""Frames of a DBC for the emulator: a message is sent when all its signals have new values."""

from __future__ import annotations

from collections.abc import Mapping

from fti.canframe import pack_can
from fti.formats.dbc_messages import DbcMessage, DbcSignal

HEAD_SIZE = 8


class FrameBuilder:
    """Builds the frames of one message."""

    def __init__(self, layout: DbcMessage) -> None:
        self.layout = layout
        self.signals: Mapping[str, DbcSignal] = {s.name: s for s in layout.signals}
        self._raw: dict[str, float] = {}
        frame = pack_can(layout.can_id, bytes(layout.length), extended=layout.extended, fd=layout.length > HEAD_SIZE)
        self._head, self._size = frame[:HEAD_SIZE], len(frame) - HEAD_SIZE

    def set_raw(self, name: str, raw: float) -> None:
        """Set the raw value of a signal for the next frame."""
        self._raw[name] = raw

    def build(self, own: Mapping[str, float]) -> bytes | None:
        """The frame, or None while signals have no new value.  own : values of counter and node."""
        values = {**self._raw, **own}
        little = big = 0
        for signal in self.layout.signals_for(values):
            raw = values.get(signal.name)
            if raw is None:
                return None
            if signal.big:
                big |= signal.insert(raw)
            else:
                little |= signal.insert(raw)
        self._raw = {}
        return self._head + self._data(little, big)

    def _data(self, little: int, big: int) -> bytes:
        """The data, padded with zeros."""
        length = self.layout.length
        if big:
            little |= int.from_bytes(big.to_bytes(length, "big"), "little")
        return little.to_bytes(self._size, "little")

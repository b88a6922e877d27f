"""The emulator's end of a device that speaks only when it is asked."""

from __future__ import annotations

MAX_HELD_BYTES = 256


class PolledDevice:
    """Keeps the last message, and gives it for every question; without a question, messages go out at once."""

    def __init__(self, question: bytes) -> None:
        self._question = question
        self._last: list[bytes] = []
        self._heard = b""

    def offer(self, messages: list[bytes]) -> list[bytes]:
        """What goes out of these messages now."""
        if not self._question:
            return messages
        self._last = messages or self._last
        return []

    def respond(self, data: bytes) -> list[bytes]:
        """The answers to the questions that are complete with these bytes."""
        if not self._question:
            return []
        *questions, rest = (self._heard + data).split(self._question)
        self._heard = rest[-MAX_HELD_BYTES:]
        return self._last * len(questions)

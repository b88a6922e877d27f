"""Faults of the bytes of a device, applied to its messages between the encoder and the line.

A stage replaces the messages of an instant.  Messages that it holds back have their own time of release, at the end of
the flight at the latest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from fti.canframe import CANFD_SIZE, FD_LENGTHS
from fti.hil.faults.values import is_active
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import BitErrors, Burst, BusOff, Freeze, Reordered

#: Replaces one message by none, one or several.
MessageEffect = Callable[[bytes], list[bytes]]
CAN_HEAD = 8


class MessageStage(Protocol):
    """One fault of one device."""

    def due_s(self) -> float | None:
        """Time of the next release [s]; None if no message is held."""

    def apply(self, t: float, messages: list[bytes]) -> list[bytes]:
        """The messages to send at t [s] instead of these; t is not before a release that is due."""


class CorruptionStage:
    """Changes a share of the messages of the interval."""

    def __init__(self, fault: DeviceFault | BusOff, effect: MessageEffect, rng: np.random.Generator) -> None:
        self._fault, self._effect, self._rng = fault, effect, rng
        self._share: float = getattr(fault, "share", 1.0)

    def due_s(self) -> float | None:
        """No message is held."""
        return None

    def apply(self, t: float, messages: list[bytes]) -> list[bytes]:
        """See ``MessageStage``."""
        if not is_active(self._fault, t):
            return messages
        return [other for message in messages for other in self._corrupt(message)]

    def _corrupt(self, message: bytes) -> list[bytes]:
        if self._share < 1.0 and self._rng.random() >= self._share:
            return [message]
        return [other for other in self._effect(message) if other]


class FreezeStage:
    """Repeats the last messages before the interval in place of new ones."""

    def __init__(self, fault: Freeze) -> None:
        self._fault = fault
        self._last: list[bytes] = []

    def due_s(self) -> float | None:
        """No message is held."""
        return None

    def apply(self, t: float, messages: list[bytes]) -> list[bytes]:
        """See ``MessageStage``."""
        if messages and not (is_active(self._fault, t) and self._last):
            self._last = messages
        return self._last if messages else []


class ReorderStage:
    """Sends a message after the next one."""

    def __init__(self, fault: Reordered, rng: np.random.Generator, end_s: float) -> None:
        self._fault, self._rng = fault, rng
        self._until_s = min(fault.to_s, end_s)
        self._held: bytes | None = None

    def due_s(self) -> float | None:
        """The end of the interval, or of the flight."""
        return None if self._held is None else self._until_s

    def apply(self, t: float, messages: list[bytes]) -> list[bytes]:
        """See ``MessageStage``."""
        found = []
        for message in messages:
            if self._held is not None:
                found += [message, self._held]
                self._held = None
            elif is_active(self._fault, t) and t < self._until_s and self._rng.random() < self._fault.share:
                self._held = message
            else:
                found.append(message)
        if self._held is not None and t >= self._until_s:
            found.append(self._held)
            self._held = None
        return found


class BurstStage:
    """Holds messages until the next multiple of ``hold_s`` after the start of the interval."""

    def __init__(self, fault: Burst, end_s: float) -> None:
        self._fault, self._until_s = fault, min(fault.to_s, end_s)
        self._waiting: list[bytes] = []
        self._release_s = 0.0

    def due_s(self) -> float | None:
        """The next release."""
        return self._release_s if self._waiting else None

    def apply(self, t: float, messages: list[bytes]) -> list[bytes]:
        """See ``MessageStage``."""
        released: list[bytes] = []
        if self._waiting and t >= self._release_s:
            released, self._waiting = self._waiting, []
        if not is_active(self._fault, t) or t >= self._until_s:
            return released + messages
        if messages and not self._waiting:
            holds = math.floor((t - self._fault.from_s) / self._fault.hold_s) + 1
            self._release_s = min(self._fault.from_s + holds * self._fault.hold_s, self._until_s)
        self._waiting += messages
        return released


def bit_error_effect(fault: BitErrors, rng: np.random.Generator, *, on_can: bool) -> MessageEffect:
    """Invert every bit with the probability of the fault; on CAN only data bits."""

    def corrupt(message: bytes) -> list[bytes]:
        begin, end = (CAN_HEAD, CAN_HEAD + message[4]) if on_can else (0, len(message))
        bits = rng.random(8 * (end - begin)) < fault.rate
        wrong = np.frombuffer(message[begin:end], np.uint8) ^ np.packbits(bits)
        return [message[:begin] + wrong.tobytes() + message[end:]]

    return corrupt


def truncation_effect(count: int, *, on_can: bool) -> MessageEffect:
    """Remove the last ``count`` bytes; from a CAN frame data bytes, rounded down to a valid length of CAN FD."""
    if not on_can:
        return lambda message: [message[:-count]]

    def truncate(message: bytes) -> list[bytes]:
        left = max(message[4] - count, 0)
        if len(message) == CANFD_SIZE:
            left = max(length for length in FD_LENGTHS if length <= left)
        data = message[CAN_HEAD : CAN_HEAD + left].ljust(len(message) - CAN_HEAD, b"\0")
        return [message[:4] + bytes([left]) + message[5:CAN_HEAD] + data]

    return truncate

"""What the controller of a Lawicel adapter says of itself: command ``F``, asked once a second.

Document: Lawicel AB, CAN232 manual, version 3 (2013), command F.  While the channel is open it is answered ``Fxx`` CR,
else BEL.

The adapter forgets its flags with the answer, so a flag says "at least once since last asked", or that a state lasts;
how many frames a full queue has cost, it does not tell.  What is counted is therefore the number of answers in which a
flag stood: about the number of seconds in which it happened.  Flags from before the channel was opened are not ours.

Many adapters do not know the command.  Some refuse it or are mute; some answer two digits without the F, which mean
something else (EasySYNC USB2-F-7001, Titan USB-2CAN).  Those are soon left alone, and have no counts, which is not the
same as zero.  Firmware for the MCP2515 answers that controller's register as if it were this one; nothing tells it
apart but bit 4, which is unused here.
"""

from __future__ import annotations

import re

from fti.clock import SECOND_NS

ASK = b"F\r"
FLAGS = {
    0x01: "slcan_rx_fifo_full",
    0x02: "slcan_tx_fifo_full",
    0x04: "slcan_error_warning",
    0x08: "slcan_data_overrun",
    0x20: "slcan_error_passive",
    0x40: "slcan_arbitration_lost",
    0x80: "slcan_bus_error",
}
UNUSED = 0x10
BUS_TROUBLE = 0x04 | 0x20 | 0x80
PERIOD_NS = SECOND_NS
#: An adapter that never answered is asked so often; one that did has closed its channel when it refuses so often.
MAX_UNANSWERED = 3
STATUS = re.compile(rb"F[0-9A-Fa-f]{2}")
BARE_STATUS = re.compile(rb"[0-9A-Fa-f]{2}")


class StatusWatch:
    """Who asks, what was answered, and the counts, over all connections.

    errors : of ``LinkStatus``; gets a key for each flag as soon as an adapter has answered
    flags  : of the last answer
    known  : the adapter has answered since its channel was opened, in the language of the manual
    """

    def __init__(self, errors: dict[str, int]) -> None:
        self._errors = errors
        self._due_ns = 0
        self._forget()

    def _forget(self) -> None:
        self.flags = 0
        self.known = False
        self._base = True  # the next answer tells of before
        self._others = 0  # answers to other commands, which come first
        self._waiting = False
        self._owed = 0  # answers that may still come, late ones too
        self._foreign = False
        self._unanswered = self._refused = 0  # since the last answer

    def begin(self, now_ns: int, commands: int) -> None:
        """The channel is opened with so many commands, and asked for the first time."""
        self._forget()
        self._others = commands
        self._due_ns = now_ns + PERIOD_NS
        self.mark_requested()

    def is_due(self, now_ns: int) -> bool:
        """Is it time to ask, and worth it?  Once a second, as this is asked."""
        if now_ns < self._due_ns:
            return False
        self._due_ns = now_ns + PERIOD_NS
        self._unanswered += self._waiting
        self._waiting = False
        self._others = 0
        return not self._foreign and (self.known or self._unanswered < MAX_UNANSWERED)

    def mark_requested(self) -> None:
        """``ASK`` was written."""
        self._waiting = True
        self._owed += 1

    def take(self, line: bytes) -> bool:
        """Is this line, without its CR, an answer to ours?  Then it is counted."""
        self._others -= not line and self._others > 0
        if not self._owed or not (STATUS.fullmatch(line) or BARE_STATUS.fullmatch(line)):
            return False
        self._owed -= 1
        flags = int(line[-2:], 16)
        if len(line) < 3 or flags & UNUSED:
            self.known, self._foreign = False, True
        elif not self._foreign:
            self._count(flags)
        return True

    def refused(self) -> bool:
        """A BEL has come: was it for us?"""
        if self._others or not self._waiting:
            self._others -= self._others > 0
            return False
        self._waiting = False
        self._unanswered += 1
        self._refused += 1
        return True

    @property
    def is_channel_closed(self) -> bool:
        """The adapter has answered, and refuses now: its channel is no longer open."""
        return self.known and self._refused >= MAX_UNANSWERED

    def _count(self, flags: int) -> None:
        self.flags, self.known, self._waiting = flags, True, False
        self._others = self._unanswered = self._refused = 0
        for bit, name in FLAGS.items():
            self._errors[name] = self._errors.get(name, 0) + (bool(flags & bit) and not self._base)
        self._base = False

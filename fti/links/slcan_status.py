"""Status flags of the CAN controller of a Lawicel adapter: command ``F``, sent once a second.

Document: Lawicel AB, CAN232 manual, version 3 (2013), command F.  While the channel is open the answer is ``Fxx`` CR,
otherwise BEL.

The answer clears the flags, so a flag means "at least once since the last request", or that a state lasts; the adapter
does not report the number of lost frames.  The counters are therefore numbers of answers with the flag: about the
number of seconds in which it occurred.  Flags from before the channel was opened are discarded.

Many adapters do not support the command.  Some refuse it or do not answer; some answer two digits without the F, with
another meaning (EasySYNC USB2-F-7001, Titan USB-2CAN).  Requests to those soon stop, and they have no counters, which
is not the same as zero.  Firmware for the MCP2515 answers with a register of that controller; only bit 4, which is
unused here, reveals it.
"""

from __future__ import annotations

import re

from fti.constants import SECOND_NS

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
#: Requests to an adapter that never answered; refusals of one that did, after which its channel counts as closed.
MAX_UNANSWERED = 3
STATUS = re.compile(rb"F[0-9A-Fa-f]{2}")
BARE_STATUS = re.compile(rb"[0-9A-Fa-f]{2}")


class StatusWatch:
    """Requests, answers and counters, over all connections.

    errors : of ``LinkStatus``; gets a key for each flag after the first answer of an adapter
    flags  : of the last answer
    is_supported : the adapter has answered as in the manual since its channel was opened
    """

    def __init__(self, errors: dict[str, int]) -> None:
        self._errors = errors
        self._due_ns = 0
        self._reset()

    def _reset(self) -> None:
        self.flags = 0
        self.is_supported = False
        self._base = True  # the next answer is the baseline
        self._others = 0  # pending answers to other commands, which precede
        self._waiting = False
        self._pending = 0  # answers that may still arrive, also late ones
        self._is_unsupported = False
        self._unanswered = self._refused = 0  # since the last answer

    def begin(self, now_ns: int, commands: int) -> None:
        """The channel is opened with so many commands and the first request."""
        self._reset()
        self._others = commands
        self._due_ns = now_ns + PERIOD_NS
        self.mark_requested()

    def is_due(self, now_ns: int) -> bool:
        """Is a request due?  True at most once a second, and only for an adapter that supports it."""
        if now_ns < self._due_ns:
            return False
        self._due_ns = now_ns + PERIOD_NS
        self._unanswered += self._waiting
        self._waiting = False
        self._others = 0
        return not self._is_unsupported and (self.is_supported or self._unanswered < MAX_UNANSWERED)

    def mark_requested(self) -> None:
        """``ASK`` was written."""
        self._waiting = True
        self._pending += 1

    def take(self, line: bytes) -> bool:
        """Is this line, without its CR, an answer to our request?  Then count it."""
        self._others -= not line and self._others > 0
        if not self._pending or not (STATUS.fullmatch(line) or BARE_STATUS.fullmatch(line)):
            return False
        self._pending -= 1
        flags = int(line[-2:], 16)
        if len(line) < 3 or flags & UNUSED:
            self.is_supported, self._is_unsupported = False, True
        elif not self._is_unsupported:
            self._count(flags)
        return True

    def take_refusal(self) -> bool:
        """A BEL arrived: was it the answer to our request?  Then count it."""
        if self._others or not self._waiting:
            self._others -= self._others > 0
            return False
        self._waiting = False
        self._unanswered += 1
        self._refused += 1
        return True

    @property
    def is_channel_closed(self) -> bool:
        """The adapter has answered earlier and refuses now: its channel is closed."""
        return self.is_supported and self._refused >= MAX_UNANSWERED

    def _count(self, flags: int) -> None:
        self.flags, self.is_supported, self._waiting = flags, True, False
        self._others = self._unanswered = self._refused = 0
        for bit, name in FLAGS.items():
            self._errors[name] = self._errors.get(name, 0) + (bool(flags & bit) and not self._base)
        self._base = False

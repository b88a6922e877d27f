"""A message for the sinks."""

from __future__ import annotations

import math
import secrets
from dataclasses import dataclass, field
from typing import NamedTuple

#: Random bytes of a boot id.
BOOT_ID_BYTES = 8


class PublishedMessage(NamedTuple):
    """A message of the bus, numbered.

    topic   : of the bus: ``/nav/glide_slope``, ``/health``, ``/alarms``, ``/event``
    payload : its JSON, see ``fti.bus.message``
    number  : 1, 2, 3, ... for each topic; a gap is a loss or a lower rate
    received_s : when it came from the bus (``time.monotonic``) [s]; by default so long ago that it is late
    """

    topic: str
    payload: bytes
    number: int
    received_s: float = -math.inf

    def with_number(self, boot: str) -> bytes:
        """The payload with the fields ``boot`` and ``number`` in front.  Boot : see ``SessionIdentity``"""
        begin = b'{"boot":"%s","number":%d' % (boot.encode(), self.number)
        return begin + (b"," if len(self.payload) > len(b"{}") else b"") + self.payload[1:]


@dataclass(frozen=True, slots=True)
class SessionIdentity:
    """By what the receivers of several aircraft distinguish them.

    aircraft, session : names of the aircraft and of the session
    boot              : changes whenever the numbers of the messages begin again at 1
    """

    aircraft: str
    session: str
    boot: str = field(default_factory=lambda: secrets.token_hex(BOOT_ID_BYTES))

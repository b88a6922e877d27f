"""A message for the sinks."""

from __future__ import annotations

import math
import secrets
from dataclasses import dataclass, field
from typing import NamedTuple

import orjson

from fti.messages.topics import OUTPUT_MAX_AGE_MS

#: Random bytes of a boot id.
BOOT_ID_BYTES = 8
#: A message that has waited longer states its new age; sinks take messages every 20 ms [ms].
MAX_UNSTATED_MS = 50.0
#: Limit of a stated age: ten days [ms].
MAX_AGE_MS = 864e6
OUTPUT_PREFIX = "/nav/"
#: Instead of an output whose age cannot be read.
NOT_VALID = b'{"late":true,"valid":false}'


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

    def numbered_json(self, boot: str, now_s: float) -> bytes:
        """The payload with ``boot`` and ``number`` in front; an output that has waited is as old as it is now.

        boot : see ``SessionIdentity``;  now_s : ``time.monotonic`` [s]
        """
        waited_ms = 1000.0 * (now_s - self.received_s)
        payload = self.payload
        if waited_ms > MAX_UNSTATED_MS and self.topic.startswith(OUTPUT_PREFIX):
            payload = _aged(payload, waited_ms)
        begin = b'{"boot":"%s","number":%d' % (boot.encode(), self.number)
        return begin + (b"," if len(payload) > len(b"{}") else b"") + payload[1:]


def _aged(payload: bytes, waited_ms: float) -> bytes:
    """The payload of an output with its present age.  A late output is not valid, nor is one without a contract."""
    try:
        fields = orjson.loads(payload)
        age_ms = min((fields.get("age_ms") or 0.0) + waited_ms, MAX_AGE_MS)
        is_late = bool(fields.get("late")) or age_ms > fields.get("max_age_ms", OUTPUT_MAX_AGE_MS)
    except (orjson.JSONDecodeError, TypeError):  # of a program that violates the contract of the bus
        return NOT_VALID
    fields |= {"age_ms": round(age_ms, 3), "late": is_late}
    if is_late:
        fields["valid"] = False
    return orjson.dumps(fields)


@dataclass(frozen=True, slots=True)
class SessionIdentity:
    """By what the receivers of several aircraft distinguish them.

    aircraft, session : names of the aircraft and of the session
    boot              : changes whenever the numbers of the messages begin again at 1
    """

    aircraft: str
    session: str
    boot: str = field(default_factory=lambda: secrets.token_hex(BOOT_ID_BYTES))

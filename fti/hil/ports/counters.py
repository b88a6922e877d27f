"""What endpoints count."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class EndpointCounters:
    """What became of the messages of one endpoint.

    too_slow_messages : of the dropped ones: those that the line had no time to carry
    """

    messages: int = 0
    bytes: int = 0
    dropped_messages: int = 0
    dropped_bytes: int = 0
    too_slow_messages: int = 0
    received_bytes: int = 0

"""Counters of endpoints."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class EndpointCounters:
    """Counters of one endpoint.

    too_slow_messages : dropped messages that exceeded the capacity of the line
    """

    messages: int = 0
    bytes: int = 0
    dropped_messages: int = 0
    dropped_bytes: int = 0
    too_slow_messages: int = 0
    received_bytes: int = 0

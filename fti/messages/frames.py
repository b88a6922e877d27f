"""Received bytes, ticks and states of links."""

from __future__ import annotations

from enum import StrEnum

from fti.messages.tables import Message
from fti.messages.units import Count, Nanoseconds


class RawFrame(Message):
    """Exactly one read of a serial line, one datagram or one CAN frame.

    link    : name of the link
    seq     : position in the session, one counter for all links in order of arrival
    t_rx_ns : FTI time of arrival [ns]
    data    : the bytes; CAN as a little-endian ``can_frame`` (16 B) or ``canfd_frame`` (72 B)
    """

    link: str
    seq: Count
    t_rx_ns: Nanoseconds
    data: bytes


#: Used instead of a device name when the operator readmits all sources.
ALL_SOURCES = "*"
TICK_LINK = "fti_tick"
#: The recorder adds a tick frame every 20 ms, so that timeouts are reproducible.
TICK_PERIOD_NS = 20_000_000


class LinkState(StrEnum):
    """State of a link; each state has a hint for the engineer at the connector."""

    ABSENT = "absent"
    DENIED = "denied"
    BUSY = "busy"
    SILENT = "silent"
    NOISE = "noise"
    INVALID = "invalid"
    WRONG_RATE = "wrong rate"
    OVERFLOW = "overflow"
    GOOD = "good"

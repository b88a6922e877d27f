"""What the recorder says of its links: the ledger that stands in the file, and health."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from fti.buffers.triple import TripleBuffer
from fti.links import Link

HEALTH_PERIOD_S = 0.5


@dataclass(slots=True)
class Unit:
    """A link with its buffers.  index : in the ring; what is sent on it has index + ``sent_offset``."""

    link: Link
    kind: str
    index: int
    received: TripleBuffer
    sent: TripleBuffer
    frames_before: int = 0


def ledger(now: int, units: Iterable[Unit]) -> dict[str, Any]:
    """Per link: frames and bytes in = recorded + held + dropped by reason."""
    return {"t_ns": now, "links": {unit.link.name: _account(unit) for unit in units}}


def _account(unit: Unit) -> dict[str, Any]:
    stats, status = unit.received.stats, unit.link.status
    dropped = {
        "buffer_overflow": {"frames": stats.dropped_frames, "bytes": stats.dropped_bytes},
        "socket_queue": {"frames": status.socket_dropped, "bytes": 0},
    }
    return {
        "in_frames": stats.frames_in + status.socket_dropped,
        "in_bytes": stats.bytes_in,
        "recorded_frames": stats.frames_out,
        "recorded_bytes": stats.bytes_out,
        "dropped": {reason: lost for reason, lost in dropped.items() if lost["frames"]},
    }


def link_health(unit: Unit, now: int) -> dict[str, Any]:
    """State, counters, rate and loads of a link, called every ``HEALTH_PERIOD_S``."""
    status, stats = unit.link.status, unit.received.stats
    rate = (status.frames - unit.frames_before) / HEALTH_PERIOD_S
    unit.frames_before = status.frames
    return {
        "kind": unit.kind,
        "state": status.state,
        "hint": status.hint,
        "frames": status.frames,
        "bytes": status.bytes,
        "rate_hz": rate,
        "age_ms": None if status.last_rx_ns is None else (now - status.last_rx_ns) / 1e6,
        "connects": status.connects,
        "dropped_frames": stats.dropped_frames + status.socket_dropped,
        "dropped_bytes": stats.dropped_bytes,
        "tx_frames": status.tx_frames,
        "load": {"receive": stats.receive, "global": stats.global_, "write": stats.write},
    }

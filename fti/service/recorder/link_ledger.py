"""The ledger of the links, which is recorded in the file, and their health.

A received frame has a sequence number; it is recorded, held in a buffer, or dropped for a reason.  Frames that the
kernel dropped because the recorder did not read in time have no number, but count as received and dropped.

    in = recorded + held + dropped, for each link, separately for received and sent frames
    assigned numbers (next_seq - first_seq) = frames in of all links, sent frames and ticks, without those of
    ``socket_queue``

Line errors (of a UART, of a CAN controller) have no frame and are counted separately, as are frames whose kernel
timestamp was refused; these have the time of the read instead.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fti.buffers.triple_buffer import TripleBuffer
from fti.links import Link
from fti.messages.health import LinkHealth
from fti.messages.ledger import DroppedFrames, FrameAccount, LedgerRecord, LinkFrameAccount, RecorderStart
from fti.service.recorder.frame_sequencer import FrameSequencer

HEALTH_PERIOD_S = 0.5


@dataclass(slots=True)
class FrameCount:
    """Frames and bytes that were not recorded."""

    frames: int = 0
    bytes: int = 0

    def add(self, frames: int, size: int) -> None:
        """Count more frames."""
        self.frames += frames
        self.bytes += size


@dataclass(slots=True)
class SnapshotOutcome:
    """Outcome of the frames that a buffer passed to the memory of the snapshot sink; the others are held there.

    recorded : in a file; not_triggered : dropped without a trigger; overflow : requested by a trigger, but dropped
    because the memory was full
    """

    recorded: FrameCount = field(default_factory=FrameCount)
    not_triggered: FrameCount = field(default_factory=FrameCount)
    overflow: FrameCount = field(default_factory=FrameCount)

    def copy(self) -> SnapshotOutcome:
        """A copy of the counters."""
        return SnapshotOutcome(replace(self.recorded), replace(self.not_triggered), replace(self.overflow))


@dataclass(slots=True)
class BufferedLink:
    """A link with its buffers.

    index                 : link index in the ring, for received frames
    outcome, sent_outcome : in mode "snapshot": outcome of the frames that left its buffers; otherwise all are recorded
    """

    link: Link
    kind: str
    index: int
    received: TripleBuffer
    sent: TripleBuffer
    frames_before: int = 0
    outcome: SnapshotOutcome | None = None
    sent_outcome: SnapshotOutcome | None = None


class LinkLedger:
    """The account of this recorder, from zero; each recorder of a session has its own."""

    def __init__(
        self, units: Sequence[BufferedLink], ticks: TripleBuffer, sequencer: FrameSequencer, started_ns: int
    ) -> None:
        self._units = units
        self._ticks = ticks
        self._sequencer = sequencer
        self._recorder = RecorderStart(pid=os.getpid(), started_ns=started_ns, first_seq=sequencer.flush())

    def read(self, now: int, *, final: bool = False) -> LedgerRecord:
        """The present ledger.  final : the last one."""
        return LedgerRecord(
            t_ns=now,
            recorder=self._recorder,
            next_seq=self._sequencer.flush(),
            final=final,
            ticks=FrameAccount(**buffer_account(self._ticks, None)),
            links={unit.link.name: link_account(unit) for unit in self._units},
        )


def link_account(unit: BufferedLink) -> LinkFrameAccount:
    """Per link: received and sent frames, line errors, refused kernel timestamps."""
    status = unit.link.status
    return LinkFrameAccount(
        **buffer_account(unit.received, unit.outcome, status.socket_dropped),
        sent=FrameAccount(**buffer_account(unit.sent, unit.sent_outcome)),
        errors=dict(status.errors),
        stamp_refused=status.stamp_refused,
    )


def buffer_account(buffer: TripleBuffer, outcome: SnapshotOutcome | None, socket_dropped: int = 0) -> dict[str, Any]:
    """Fields of the account of one buffer.  Bytes dropped by the kernel are unknown: None, and not in the sum."""
    totals = outcome.copy() if outcome else SnapshotOutcome()  # read before the buffer: later frames count as held
    stats = buffer.stats
    recorded = totals.recorded if outcome else FrameCount(stats.frames_out, stats.bytes_out)
    dropped = {
        "socket_queue": DroppedFrames(socket_dropped, None),
        "buffer_overflow": DroppedFrames(stats.dropped_frames, stats.dropped_bytes),
        "snapshot_overflow": DroppedFrames(totals.overflow.frames, totals.overflow.bytes),
        "not_triggered": DroppedFrames(totals.not_triggered.frames, totals.not_triggered.bytes),
    }
    frames, size = stats.frames_in - recorded.frames, stats.bytes_in - recorded.bytes
    return {
        "in_frames": stats.frames_in + socket_dropped,
        "in_bytes": stats.bytes_in,
        "recorded_frames": recorded.frames,
        "recorded_bytes": recorded.bytes,
        "held_frames": frames - sum(lost.frames for lost in dropped.values()) + socket_dropped,
        "held_bytes": size - sum(lost.bytes or 0 for lost in dropped.values()),
        "dropped": {reason: lost for reason, lost in dropped.items() if lost.frames},
    }


def link_health(unit: BufferedLink, now: int) -> LinkHealth:
    """State, counters, rate, loads and account of a link; call it every ``HEALTH_PERIOD_S``."""
    status, stats = unit.link.status, unit.received.stats
    rate = (status.frames - unit.frames_before) / HEALTH_PERIOD_S
    unit.frames_before = status.frames
    return LinkHealth(
        kind=unit.kind,
        state=status.state,
        hint=status.hint,
        frames=status.frames,
        bytes=status.bytes,
        rate_hz=rate,
        age_ms=None if status.last_rx_ns is None else (now - status.last_rx_ns) / 1e6,
        connects=status.connects,
        stamp_refused=status.stamp_refused,
        dropped_frames=stats.dropped_frames + status.socket_dropped,
        dropped_bytes=stats.dropped_bytes,
        tx_frames=status.tx_frames,
        echo_bytes=status.echo_bytes,
        load={"receive": stats.receive, "global": stats.global_, "write": stats.write},
        ledger=link_account(unit),
    )

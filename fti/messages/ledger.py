"""The ledger of the links: received, recorded, held and dropped frames; see ``fti.service.recorder.link_ledger``."""

from __future__ import annotations

from msgspec import UNSET, UnsetType

from fti.messages.tables import Message
from fti.messages.units import Bytes, Count, Nanoseconds


class DroppedFrames(Message):
    """Frames that were dropped for one reason.  bytes : None where the kernel dropped an unknown number"""

    frames: Count
    bytes: Bytes | None


class FrameAccount(Message, kw_only=True):
    """The frames of a buffer: in = recorded + held + dropped.  dropped : by reason"""

    in_frames: Count
    in_bytes: Bytes
    recorded_frames: Count
    recorded_bytes: Bytes
    held_frames: Count
    held_bytes: Bytes
    dropped: dict[str, DroppedFrames]


class LinkFrameAccount(FrameAccount, kw_only=True):
    """The received frames of a link, and those sent.

    errors        : line errors by kind
    stamp_refused : frames whose kernel timestamp was refused
    """

    sent: FrameAccount
    errors: dict[str, Count]
    stamp_refused: Count


class RecorderStart(Message, kw_only=True):
    """Identity of a recorder: process number, start, and number of its first frame."""

    pid: Count
    started_ns: Nanoseconds
    first_seq: Count


class LedgerRecord(Message, kw_only=True):
    """The account of a recorder, from zero.

    next_seq : number of the next frame;  final : the last ledger of the recorder
    complete : true: everything is in this record.  false: an entry of links that is not in this record has not changed
               since the record of this topic with log time since_ns.  Without this field a record is complete
    since_ns : log time of the record that this one continues; only where complete is false.  Without that record, the
               entries that are not in this one are unknown until the next complete record, at most 10 s
    """

    t_ns: Nanoseconds
    recorder: RecorderStart
    next_seq: Count
    final: bool
    ticks: FrameAccount
    links: dict[str, LinkFrameAccount]
    complete: bool | UnsetType = UNSET
    since_ns: Nanoseconds | UnsetType = UNSET

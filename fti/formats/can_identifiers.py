"""Identifier and length of a CAN frame, for decoders that look up messages by identifier."""

from __future__ import annotations

import struct

from fti.canframe import CAN_SIZE, CANFD_SIZE, ERROR, REMOTE

_HEAD = struct.Struct("<IB")
NO_FRAME = (0xFFFF_FFFF, 0)


def frame_head(data: bytes) -> tuple[int, int]:
    """First word (identifier with flags) and length; for invalid data a word that no message has.

    Error frames and remote requests also match no message: their flags are set.
    """
    if len(data) != CAN_SIZE and len(data) != CANFD_SIZE:
        return NO_FRAME
    head: tuple[int, int] = _HEAD.unpack_from(data)
    return head if head[1] <= len(data) - 8 else NO_FRAME


def skip_reason(data: bytes) -> str:
    """Reason why a frame with an unknown word is skipped: "no_frame", "error_frame", "remote_frame", "other_id"."""
    word, length = frame_head(data)
    if (word, length) == NO_FRAME:
        return "no_frame"
    if word & (ERROR | REMOTE):
        return "error_frame" if word & ERROR else "remote_frame"
    return "other_id"

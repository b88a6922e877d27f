"""Hash of the received data of a link: equal for a session and for the recording of its replay.

serial     SHA-256 of all bytes in order; their division into reads depends on the machine, not on the device
udp, can   SHA-256 of all frames in order, each preceded by its length as eight bytes, little-endian
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from fti.logger.reading.recording import Recording
from fti.messages.frames import TICK_LINK

LENGTH_BYTES = 8


@dataclass(frozen=True, slots=True)
class LinkHash:
    """Hash of the received data of a link.  kind : serial, udp, can; sha256 : hexadecimal"""

    kind: str
    frames: int
    bytes: int
    sha256: str

    def is_same(self, other: LinkHash) -> bool:
        """Are the bytes equal; for datagrams and CAN frames, are the frames equal?"""
        return (self.kind, self.sha256) == (other.kind, other.sha256)


class _Sum:
    """The hash of one link, updated frame by frame."""

    def __init__(self, kind: str) -> None:
        self._kind, self._hash = kind, hashlib.sha256()
        self._frames = self._bytes = 0

    def add(self, data: bytes) -> None:
        if self._kind != "serial":
            self._hash.update(len(data).to_bytes(LENGTH_BYTES, "little"))
        self._hash.update(data)
        self._frames += 1
        self._bytes += len(data)

    @property
    def result(self) -> LinkHash:
        return LinkHash(self._kind, self._frames, self._bytes, self._hash.hexdigest())


def link_hashes(recording: Recording) -> dict[str, LinkHash]:
    """The hash of every link, silent ones included.  Raises RecordingError as ``Recording.frames``."""
    sums = {link: _Sum(kind) for link, kind in recording.links.items()}
    for frame in recording.frames():
        if frame.link != TICK_LINK:
            sums.setdefault(frame.link, _Sum("unknown")).add(frame.data)
    return {link: found.result for link, found in sums.items()}

"""Are the bytes that the emulator sent on each link in the raw file?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from fti.config import CanLink, Config
from fti.logger.reading.recording import RAW, Recording
from fti.post.score.flown import Flown, SentOnLink
from fti.post.score.outputs.row import Check, OutputRow, verdict_of

#: A recorded CAN frame [bytes]: the kernel's ``can_frame`` and ``canfd_frame``.
CAN_BYTES, CAN_FD_BYTES = 16, 72
#: So much of what was sent must be recorded: a computer that is overloaded loses some of it, one without ports nothing.
LEAST_SHARE, ACCELERATED_SHARE = 0.985, 0.999
#: Bytes of the flight may arrive so long after it [ns].
AFTER_NS = 3_000_000_000


def recorded_links(recording: Recording, flown: Flown, config: Config) -> Iterator[OutputRow]:
    """A row for each link; nothing where the truth does not state what was sent.  Raises RecordingError."""
    if not flown.sent:
        return
    until_ns = flown.begin_ns + round(flown.truth.end_s * 1e9) + AFTER_NS
    recorded = Counter[str]()
    for topic, t_ns, _, _, data in recording.messages(RAW, kind="raw"):
        if flown.begin_ns <= t_ns <= until_ns:
            recorded[topic.removeprefix(RAW)] += len(data)
    least = LEAST_SHARE if flown.real_time else ACCELERATED_SHARE
    for link in config.link:
        if sent := flown.sent.get(link.name):
            frame_bytes = 0 if not isinstance(link, CanLink) else CAN_FD_BYTES if link.fd else CAN_BYTES
            yield _row(link.name, recorded[link.name], sent, frame_bytes, least)


def _row(link: str, recorded: int, sent: SentOnLink, frame_bytes: int, least: float) -> OutputRow:
    """In bytes; of a CAN bus in frames, for an adapter sends them in another form."""
    found, expected, unit = (
        (recorded // frame_bytes, sent.messages, "frames") if frame_bytes else (recorded, sent.bytes, "bytes")
    )
    share = found / expected if expected else 1.0
    return OutputRow(
        f"{RAW}{link}",
        Check.RECORDED,
        "",
        verdict_of(share >= least),
        f"{found} of {expected} {unit} that were sent",
        f">= {least:.1%}",
    )

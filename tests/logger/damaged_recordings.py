"""Small recordings to damage, and what may and must be found in them afterwards."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from fti.logger.records import HEAD
from fti.logger.recovery.extract import extract_file
from fti.logger.recovery.recovered_sequence import RecoveredSequence
from fti.logger.recovery.report import FileReport
from fti.logger.stream_writer import StreamWriter
from tests.logger.official_reader import MessageTuple, read_closed, read_stream

Span = tuple[int, int]


def payload(n: int) -> bytes:
    """Bytes of the n-th message; some hold what looks like records, some hold zeros."""
    data_end = b"\x0f\x04\0\0\0\0\0\0\0"
    kinds = (b"\x06\x28\0\0\0\0\0\0\0", struct.pack("<BQH", 5, 30, 1), bytes(n % 23), data_end * 2, b"")
    return bytes([n % 251]) * (n % 17) + kinds[n % len(kinds)]


def write_own(path: Path, messages: int = 90, chunk_bytes: int = 700, *, finish: bool = True) -> bytes:
    """A recording of ours with several chunks, attachments and metadata."""
    writer = StreamWriter(path, chunk_bytes=chunk_bytes)
    writer.add_attachment("config.toml", "text/plain", b"name = 1\n", 1)
    writer.add_metadata("fti", {"name": "small"})
    schema = writer.add_schema("note", "jsonschema", b"{}")
    channels = [writer.add_channel("/raw/a", "x-fti-raw"), writer.add_channel("/raw/b", "x-fti-raw")]
    note = writer.add_channel("/fti/event", "json", schema)
    for n in range(messages):
        writer.write(channels[n % 2], 10**9 + n * 10**6, payload(n), n)
        if n % 10 == 0:
            writer.write(note, 10**9 + n * 10**6, b'{"text": "%d"}' % n)
        writer.flush()
    if finish:
        writer.close()
    else:
        writer.abandon()
    return path.read_bytes()


def write_foreign(path: Path, compression: CompressionType, messages: int = 90) -> bytes:
    """A recording of the official writer."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=500, compression=compression)
        writer.start("other")
        ids = [writer.register_channel(topic, "x", 0) for topic in ("/a", "/b")]
        for n in range(messages):
            writer.add_message(ids[n % 2], 10**9 + n, payload(n), 10**9 + n, n)
        writer.add_attachment(1, 1, "notes.txt", "text/plain", b"some text")
        writer.finish()  # type: ignore[no-untyped-call]
    return path.read_bytes()


class Original:
    """A whole file: its bytes, its messages and where its chunks stand."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.messages = read_stream(data)
        summary = make_reader(BytesIO(data)).get_summary()
        self.chunks: list[tuple[Span, list[MessageTuple]]] = []
        at = 0
        for index in sorted(summary.chunk_indexes if summary else [], key=lambda index: index.chunk_start_offset):
            begin, end = index.chunk_start_offset, index.chunk_start_offset + index.chunk_length
            count = _messages_in(data, begin, end)
            self.chunks.append(((begin, end), self.messages[at : at + count]))
            at += count

    def must_hold(self, damage: Span) -> list[MessageTuple]:
        """The messages of the chunks that the damage did not hit."""
        return [m for (begin, end), held in self.chunks if end <= damage[0] or begin >= damage[1] for m in held]


def _messages_in(data: bytes, begin: int, end: int) -> int:
    """Messages of a chunk, by the message index behind it."""
    count = 0
    while data[end] == 7:
        _, length = HEAD.unpack_from(data, end)
        count += (length - 6) // 16
        end += HEAD.size + length
    return count


def recover(data: bytes, folder: Path) -> tuple[list[MessageTuple], FileReport]:
    """What is recovered from these bytes."""
    source, out = folder / "damaged.mcap", folder / "recovered.mcap"
    source.write_bytes(data)
    out.unlink(missing_ok=True)
    report = extract_file(source, out, RecoveredSequence(), lambda _: None)
    assert source.read_bytes() == data
    messages = read_closed(out)
    assert report.messages == len(messages)
    return messages, report


def is_part(found: Sequence[MessageTuple], original: Sequence[MessageTuple]) -> bool:
    """Are these messages among those, bit for bit, in the same order?"""
    rest = iter(original)
    return all(any(message == other for other in rest) for message in found)

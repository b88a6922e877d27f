"""The cursor over records: whole ones only, whatever is cut off; the bytes are packed here."""

from __future__ import annotations

import errno
import os
import struct
from itertools import accumulate
from pathlib import Path

import pytest

from fti.errors import MissingError
from fti.logger.reading.mcap_file import McapFile
from fti.logger.reading.record_cursor import attachment_content, channel_fields, records_in
from tests.logger.damaged_recordings import write_own


def record(op: int, body: bytes) -> bytes:
    return struct.pack("<BQ", op, len(body)) + body


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


MESSAGE = record(5, struct.pack("<HIQQ", 3, 7, 11, 12) + b"data")
#: Shorter than the head of a message.
CHANNEL = record(4, struct.pack("<HH", 3, 0) + text(b"/a") + text(b"") + text(b""))
RECORDS = (CHANNEL, MESSAGE, record(0x80, bytes(5)), MESSAGE, record(5, bytes(22)), record(0x90, b""), CHANNEL)
ENDS = list(accumulate(map(len, RECORDS)))


@pytest.mark.parametrize("size", range(ENDS[-1] + 1))
def test_a_walk_yields_the_whole_records_before_a_cut(size: int) -> None:
    whole = [end for end in ENDS if end <= size]
    found = list(records_in(b"".join(RECORDS)[:size]))
    assert [(at, end) for at, end, _ in found] == list(zip([0, *ENDS], whole, strict=False))
    assert [head[:2] for *_, head in found] == [(data[0], len(data) - 9) for data in RECORDS[: len(whole)]]


def test_the_head_of_a_message_has_its_channel_number_and_times() -> None:
    ((_, _, head),) = records_in(MESSAGE)
    assert head == (5, 26, 3, 7, 11, 12)


def test_a_message_without_its_head_ends_the_walk() -> None:
    assert [end for _, end, _ in records_in(MESSAGE + record(5, bytes(21)) + MESSAGE)] == [len(MESSAGE)]


def test_fields_longer_than_their_record_are_refused() -> None:
    with pytest.raises(struct.error):
        channel_fields(record(4, struct.pack("<HH", 3, 0) + text(b"/a") + struct.pack("<I", 9) + b"json"))
    head = struct.pack("<QQ", 1, 1) + text(b"a.txt") + text(b"text/plain")
    assert attachment_content(record(9, head + struct.pack("<Q", 3) + b"abc" + bytes(4))) == ("a.txt", b"abc")
    with pytest.raises(struct.error):
        attachment_content(record(9, head + struct.pack("<Q", 8) + b"abc" + bytes(4)))


def test_a_reader_reports_a_medium_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only recovery continues behind unreadable bytes."""
    path = tmp_path / "a.mcap"
    write_own(path)
    read = os.pread

    def refuse(fd: int, size: int, at: int) -> bytes:
        if at >= 1000:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return read(fd, size, at)

    monkeypatch.setattr(os, "pread", refuse)
    with pytest.raises(MissingError, match=r"a\.mcap: cannot be read: Input/output error"):
        list(McapFile(path).items())

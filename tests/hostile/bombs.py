"""Small files that claim or contain very much data: written as raw bytes, so that a megabyte represents gigabytes."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import zstandard

from tests.hostile.recipes import CONFIG as TOML

MAGIC = b"\x89MCAP0\r\n"
BEGIN = 1_767_323_045_000_000_000


def record(op: int, body: bytes) -> bytes:
    return struct.pack("<BQ", op, len(body)) + body


def text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def channel(number: int, topic: str | bytes, encoding: str = "json", table: bytes = b"") -> bytes:
    return record(4, struct.pack("<HH", number, 0) + text(topic) + text(encoding) + text(table))


def message(channel_id: int, data: bytes = b"", seq: int = 0, t: int = BEGIN) -> bytes:
    return record(5, struct.pack("<HIQQ", channel_id, seq, t, t) + data)


def chunk(content: bytes, compression: str = "zstd") -> bytes:
    stored = zstandard.ZstdCompressor(level=3).compress(content) if compression == "zstd" else content
    head = struct.pack("<QQQI", BEGIN, BEGIN, len(content), zlib.crc32(content))
    return record(6, head + text(compression) + struct.pack("<Q", len(stored)) + stored)


def metadata(name: str, table: dict[str, str]) -> bytes:
    return record(12, text(name) + text(b"".join(text(key) + text(value) for key, value in table.items())))


def attachment(name: str, data: bytes) -> bytes:
    body = struct.pack("<QQ", 0, 0) + text(name) + text("text/plain") + struct.pack("<Q", len(data)) + data
    return record(9, body + struct.pack("<I", zlib.crc32(body)))


def file(*records: bytes, ended: bool = True) -> bytes:
    """A file with these records; ended : with an empty summary and a footer."""
    begin = MAGIC + record(1, text("fti") + text("fti")) + KIND
    body = begin + b"".join(records)
    if not ended:
        return body
    data_end = record(15, bytes(4))
    foot = struct.pack("<BQQQ", 2, 20, 0, 0)
    return body + data_end + foot + struct.pack("<I", zlib.crc32(foot)) + MAGIC


KIND = metadata("fti.file", {"kind": "raw", "session": "x"}) + metadata("fti.links", {"gnss": "udp"})
CONFIG = attachment("config.toml", TOML.encode())
RAW = channel(1, "/raw/gnss", "x-fti-raw")


def _frames(count: int, step: int = 1, begin: int = 0) -> bytes:
    """Messages without content, of which the numbers rise by a step."""
    one = bytearray(message(1))
    data = bytearray()
    for k in range(count):
        struct.pack_into("<I", one, 11, (begin + k * step) % 2**32)
        data += one
    return bytes(data)


def _many_messages() -> bytes:
    return file(CONFIG, chunk(RAW + message(1) * (60 * 2**20 // 31)))


def _many_messages_again() -> bytes:
    return file(CONFIG, *[chunk(RAW + message(1) * 500_000)] * 6)


def _zeros() -> bytes:
    return file(CONFIG, chunk(RAW + message(1, bytes(300 * 2**20))))


def _holes() -> bytes:
    return file(CONFIG, *(chunk(RAW + _frames(250_000, 2, 500_000 * k)) for k in range(6)))


def _topics() -> bytes:
    topics = b"".join(
        channel(k, f"/x/{k}") + message(k, b"{}") + message(k, b"{}", 1, BEGIN + 10**9) for k in range(65_000)
    )
    return file(CONFIG, chunk(topics))


def _long_topics() -> bytes:
    return file(
        CONFIG,
        *(chunk(b"".join(channel(k + 500 * n, b"/x" * 50_000 + b"%d" % k) for k in range(500))) for n in range(8)),
    )


def _channel_tables() -> bytes:
    table = b"".join(text(b"%d" % k) + text(b"") for k in range(6000))
    return file(
        CONFIG,
        *(chunk(b"".join(channel(k + 500 * n, f"/x/{n}/{k}", "json", table) for k in range(500))) for n in range(8)),
    )


def _schemas() -> bytes:
    body = b"{}" + b" " * 100_000
    many = [record(3, struct.pack("<H", k + 1) + text("s") + text("jsonschema") + text(body)) for k in range(6_000)]
    return file(CONFIG, *(chunk(b"".join(many[k : k + 500]) + RAW + message(1)) for k in range(0, 6_000, 500)))


def _json_message(body: bytes, topic: str = "/fti/event") -> bytes:
    return file(CONFIG, chunk(channel(1, topic) + message(1, body) * 3))


def _long_events() -> bytes:
    body = json.dumps({"level": 2, "name": "x", "message": "y" * 4_000_000}).encode()
    return file(CONFIG, *[chunk(channel(1, "/fti/event") + message(1, body) * 15)] * 30)


def _gap_notes() -> bytes:
    body = b'{"kind":"buffer_overflow","link":"gnss","first_seq":1,"last_seq":2,"frames":1}'
    return file(CONFIG, *[chunk(channel(1, "/fti/gap") + message(1, body) * 200_000)] * 6)


def _ledgers() -> bytes:
    return file(CONFIG, *[chunk(channel(1, "/fti/ledger") + message(1, b"{}") * 200_000)] * 4)


def _columns() -> bytes:
    bodies = (json.dumps({f"{n}.{k}": k for k in range(60_000)}).encode() for n in range(30))
    return file(CONFIG, *(chunk(channel(1, "/x") + message(1, body)) for body in bodies))


def _lists() -> bytes:
    return _json_message(b"[" + b"[]," * 5_000_000 + b"0]")


def _lengths() -> bytes:
    head = struct.pack("<BQ", 9, 2**40)
    return file(
        head + struct.pack("<QQ", 0, 0) + text("config.toml") + text("x") + struct.pack("<Q", 2**40), ended=False
    )


def _long_name() -> bytes:
    return file(record(12, struct.pack("<I", 2**32 - 1) + b"x" * 100), ended=False)


def _declared() -> bytes:
    """A chunk whose head and frame tell of a gigabyte."""
    data = bytearray(chunk(RAW + message(1, bytes(2**20))))
    struct.pack_into("<Q", data, 9 + 16, 2**30)
    return file(CONFIG, bytes(data))


def _metadata() -> bytes:
    return file(*(metadata(f"t{k}", {"a": "b" * 1_000_000}) for k in range(6)))


BOMBS: dict[str, Callable[[], bytes]] = {
    "messages": _many_messages,
    "messages in many chunks": _many_messages_again,
    "zeros": _zeros,
    "holes": _holes,
    "topics": _topics,
    "long topics": _long_topics,
    "channel tables": _channel_tables,
    "schemas": _schemas,
    "long events": _long_events,
    "gap notes": _gap_notes,
    "ledgers": _ledgers,
    "columns": _columns,
    "lists": _lists,
    "lengths": _lengths,
    "long name": _long_name,
    "declared": _declared,
    "metadata": _metadata,
}


def write(name: str, folder: Path) -> Path:
    """A session folder with one file."""
    folder.mkdir(parents=True)
    (folder / "x_000.mcap").write_bytes(BOMBS[name]())
    return folder

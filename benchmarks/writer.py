"""The recorder's MCAP writer beside the official one: cost of a message, and what a kill -9 loses.

    python benchmarks/writer.py [--messages N]

Cost: messages of 44 bytes on 23 channels, written and flushed every 42 messages (20 ms at 2.1 kmsg/s); ``sync`` is not
counted.  Loss: a child process writes 2.1 kmsg/s for some seconds and is killed; what it had handed over (it counts in
shared memory) is compared with what the official StreamReader finds.
"""

from __future__ import annotations

import argparse
import mmap
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from fti.logger.stream_writer import StreamWriter

CHANNELS = 23
BATCH = 42  # 20 ms at 2.1 kmsg/s
PAYLOAD = bytes(range(44))
Put = Callable[[int], None]
Act = Callable[[], None]


def open_ours(path: Path) -> tuple[Put, Act, Act]:
    writer = StreamWriter(path)
    ids = [writer.add_channel(f"/raw/link{n}", "x-fti-raw") for n in range(CHANNELS)]
    write = writer.write
    return lambda n: write(ids[n % CHANNELS], n, PAYLOAD, n), writer.flush, writer.close


def open_official(path: Path) -> tuple[Put, Act, Act]:
    """The official writer, uncompressed, as it is: it writes when a chunk is full."""
    put, _, close = open_official_flushed(path)
    return put, lambda: None, close


def open_official_flushed(path: Path) -> tuple[Put, Act, Act]:
    """The official writer, flushed as often as ours: each flush ends a chunk."""
    stream = path.open("wb")
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start("fti")
    ids = [writer.register_channel(f"/raw/link{n}", "x-fti-raw", 0) for n in range(CHANNELS)]
    add, flush, finish = writer.add_message, writer.flush, writer.finish

    def close() -> None:
        finish()  # type: ignore[no-untyped-call]
        stream.close()

    return lambda n: add(ids[n % CHANNELS], n, PAYLOAD, n, n), flush, close


WRITERS = {
    "fti, flushed every 20 ms": open_ours,
    "mcap.writer, default": open_official,
    "mcap.writer, flushed every 20 ms": open_official_flushed,
}


def measure_cost(name: str, folder: Path, messages: int) -> tuple[float, float]:
    """Mean cost of a message [us] and size of the file for each message [B]; best of three."""
    best = float("inf")
    path = folder / "cost.mcap"
    for _ in range(3):
        path.unlink(missing_ok=True)
        put, flush, close = WRITERS[name](path)
        started = time.perf_counter()
        for first in range(0, messages, BATCH):
            for n in range(first, first + BATCH):
                put(n)
            flush()
        best = min(best, time.perf_counter() - started)
        close()
    return best / messages * 1e6, path.stat().st_size / messages


def write_until_killed(name: str, path: Path, counter: Path) -> None:
    """The child: hands over 42 messages every 20 ms and counts them."""
    put, flush, _ = WRITERS[name](path)
    with counter.open("r+b") as stream, mmap.mmap(stream.fileno(), 8) as shared:
        n, due = 0, time.monotonic()
        while True:
            for n in range(n, n + BATCH):  # noqa: B020
                put(n)
            n += 1
            shared[:] = struct.pack("<Q", n)
            flush()
            due += 0.02
            time.sleep(max(0.0, due - time.monotonic()))


def measure_loss(name: str, folder: Path, seconds: float) -> tuple[int, int]:
    """Messages handed over, and those found after a kill -9."""
    path, counter = folder / "loss.mcap", folder / "counter"
    path.unlink(missing_ok=True)
    counter.write_bytes(bytes(8))
    child = subprocess.Popen([sys.executable, __file__, "--child", name, str(path), str(counter)])
    deadline = time.monotonic() + 60
    while struct.unpack("<Q", counter.read_bytes())[0] < seconds * 2100 and time.monotonic() < deadline:
        time.sleep(0.01)
    child.send_signal(signal.SIGKILL)
    child.wait()
    return struct.unpack("<Q", counter.read_bytes())[0], count_messages(path.read_bytes())


def count_messages(data: bytes) -> int:
    """Messages that the official StreamReader finds before the break."""
    count = 0
    try:
        for record in StreamReader(BytesIO(data)).records:
            count += isinstance(record, Message)
    except (McapError, struct.error):
        pass
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=210_000)
    parser.add_argument("--child", nargs=3, metavar=("WRITER", "FILE", "COUNTER"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        write_until_killed(args.child[0], Path(args.child[1]), Path(args.child[2]))
    print(f"{os.cpu_count()} cores, Python {sys.version.split()[0]}, {args.messages} messages of {len(PAYLOAD)} B")
    print(
        f"{'writer':34} {'us/message':>10} {'ratio':>6} {'B/message':>10} {'handed over':>12} {'lost by kill -9':>16}"
    )
    with tempfile.TemporaryDirectory() as folder:
        first = None
        for name in WRITERS:
            cost, size = measure_cost(name, Path(folder), args.messages)
            first = first or cost
            given, found = measure_loss(name, Path(folder), 3.0)
            lost = f"{given - found} ({(given - found) / 2100:.2f} s)"
            print(f"{name:34} {cost:10.2f} {cost / first:6.1f} {size:10.1f} {given:12} {lost:>16}")


if __name__ == "__main__":
    main()

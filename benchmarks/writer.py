"""The recorder's MCAP writer compared with the alternatives of a user: cost of a message, and loss after kill -9.

    python benchmarks/writer.py [--messages N]

Cost: messages of 48 bytes (CAN FD frames for python-can) on 23 channels, handed over as the recorder does: 20 ms of
messages at a time, and then a flush where the writer can.  At 2.1 kmsg/s that is 42 messages, at 200 kmsg/s 4000.  Of
five rounds the best counts, which excludes the load of other processes.
Loss: a child process writes 2.1 kmsg/s for some seconds and is killed; what it had handed over (it counts in shared
memory) is compared with what is found in the file.
"""

from __future__ import annotations

import argparse
import mmap
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from io import BytesIO
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import can
import foxglove
from foxglove.mcap import MCAPWriteOptions
from mcap.exceptions import McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.frame_batch import FrameBatch, make_batch
from fti.links._recvmmsg import MAX_DATAGRAMS
from fti.logger.stream_writer import StreamWriter

CHANNELS = 23
BATCHES = {"2.1": 42, "200": 4000}  # 20 ms at so many kmsg/s
PAYLOAD = bytes(range(48))
TOPICS = [f"/raw/link{n}" for n in range(CHANNELS)]
MAX_OFFICIAL_RATIO = 1 / 3
MAX_FILE_RATIO = 5.0
ROUNDS = 5
#: Messages of each channel in batches of the recorder: at most this many of one system call.
Batch = list[tuple[int, list[FrameBatch]]]


class Target(NamedTuple):
    """A writer: put takes a batch, close finishes; held must live until then."""

    put: Callable[[Batch], None]
    close: Callable[[], None]
    held: object = None


def open_ours(path: Path) -> Target:
    writer = StreamWriter(path)
    ids = [writer.add_channel(topic, "x-fti-raw") for topic in TOPICS]

    def put(batch: Batch) -> None:
        writer.write_batches([(ids[channel], bursts) for channel, bursts in batch])
        writer.flush()

    return Target(put, writer.close)


def open_official(path: Path) -> Target:
    """The official writer, uncompressed, as it is: it writes when a chunk is full."""
    return _official(path, lambda writer: None)


def open_official_flushed(path: Path) -> Target:
    """The official writer, flushed as often as ours: each flush ends a chunk."""
    return _official(path, lambda writer: writer.flush())


def _official(path: Path, flush: Callable[[Any], None]) -> Target:
    stream = path.open("wb")
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start("fti")
    ids = [writer.register_channel(topic, "x-fti-raw", 0) for topic in TOPICS]
    add: Any = writer.add_message
    finish: Any = writer.finish

    def put(batch: Batch) -> None:
        for channel, bursts in batch:
            for seqs, times, frames, _ in bursts:
                for seq, time_ns, data in zip(seqs, times, frames, strict=True):
                    add(ids[channel], time_ns, data, time_ns, seq)
        flush(writer)

    def close() -> None:
        finish()
        stream.close()

    return Target(put, close)


def open_foxglove(path: Path) -> Target:
    """Foxglove's SDK, whose writer is compiled."""
    context = foxglove.Context()
    options = MCAPWriteOptions(compression=None)
    writer = foxglove.open_mcap(path, context=context, writer_options=options)
    schema = foxglove.Schema(name="", encoding="", data=b"")
    channels = [foxglove.Channel(t, message_encoding="x-fti-raw", schema=schema, context=context) for t in TOPICS]

    def put(batch: Batch) -> None:
        for channel, bursts in batch:
            log = channels[channel].log
            for _, times, frames, _ in bursts:
                for time_ns, data in zip(times, frames, strict=True):
                    log(data, log_time=time_ns)

    def close() -> None:
        for channel in channels:
            channel.close()
        writer.close()

    return Target(put, close, context)  # without the context its channels are closed, and take nothing


def open_can(path: Path, make: Callable[[Path], Any]) -> Target:
    """A logger of python-can; its messages are made beforehand, as a bus hands them over ready."""
    logger = make(path)
    messages = [can.Message(arbitration_id=n, data=PAYLOAD, is_fd=True, timestamp=1e9) for n in range(CHANNELS)]

    def put(batch: Batch) -> None:
        take = logger.on_message_received
        for channel, bursts in batch:
            message = messages[channel]
            for _, _, frames, _ in bursts:
                for _ in frames:
                    take(message)

    return Target(put, logger.stop)


def open_file(path: Path) -> Target:
    """The bytes alone."""
    stream = path.open("wb")

    def put(batch: Batch) -> None:
        write = stream.write
        for _, bursts in batch:
            for _, _, frames, _ in bursts:
                for data in frames:
                    write(data)

    return Target(put, stream.close)


OURS, OFFICIAL, FILE = "fti, flushed every 20 ms", "mcap.writer, default", "file.write of the bytes alone"
WRITERS: dict[str, Callable[[Path], Target]] = {
    OURS: open_ours,
    OFFICIAL: open_official,
    "mcap.writer, flushed every 20 ms": open_official_flushed,
    "foxglove-sdk": open_foxglove,
    "python-can BLF": lambda path: open_can(path, can.BLFWriter),
    "python-can ASC": lambda path: open_can(path, can.ASCWriter),
    FILE: open_file,
}
#: Writers whose files a reader of MCAP can read.
KILLED_WRITERS = (OURS, OFFICIAL, "mcap.writer, flushed every 20 ms", "foxglove-sdk")


def batches(size: int, first: int = 0) -> Batch:
    """Messages, spread over the channels."""
    found: Batch = []
    for channel in range(min(CHANNELS, size)):
        number = len(range(channel, size, CHANNELS))
        shares = [min(MAX_DATAGRAMS, number - done) for done in range(0, number, MAX_DATAGRAMS)]
        starts = accumulate(shares, initial=first)
        found.append((channel, [_burst(start, share) for start, share in zip(starts, shares, strict=False)]))
        first += number
    return found


def _burst(first: int, number: int) -> FrameBatch:
    return make_batch(first, [1_000_000_000 + first + n for n in range(number)], [PAYLOAD] * number)


def messages_in(batch: Batch) -> int:
    """Number of messages in a file."""
    return sum(len(burst[2]) for _, bursts in batch for burst in bursts)


def measure_cost(name: str, folder: Path, work: list[Batch]) -> float:
    """Mean cost of a message [us]."""
    path = folder / "cost"
    path.unlink(missing_ok=True)
    target = WRITERS[name](path)
    started = time.perf_counter()
    for batch in work:
        target.put(batch)
    elapsed_s = time.perf_counter() - started
    target.close()
    messages = sum(map(messages_in, work))
    if name in KILLED_WRITERS and (there := count_messages(path.read_bytes())) < messages:
        raise RuntimeError(f"{name}: {there} of {messages} messages are in its file")
    return elapsed_s / messages * 1e6


def measure_costs(folder: Path, messages: int) -> dict[str, list[float]]:
    """Of every writer, for each size of batch; the best of the rounds, in each of which all run in turn."""
    works = [[batches(size, first) for first in range(0, messages, size)] for size in BATCHES.values()]
    rounds = [{name: [measure_cost(name, folder, work) for work in works] for name in WRITERS} for _ in range(ROUNDS)]
    return {name: [min(costs) for costs in zip(*(found[name] for found in rounds), strict=True)] for name in WRITERS}


def write_until_killed(name: str, path: Path, counter: Path) -> None:
    """The child: hands over 42 messages every 20 ms and counts them."""
    target = WRITERS[name](path)
    size = BATCHES["2.1"]
    with counter.open("r+b") as stream, mmap.mmap(stream.fileno(), 8) as shared:
        n, due = 0, time.monotonic()
        while True:
            target.put(batches(size, n))
            n += size
            shared[:] = struct.pack("<Q", n)
            due += 0.02
            time.sleep(max(0.0, due - time.monotonic()))


def measure_loss(name: str, folder: Path, seconds: float) -> tuple[int, int]:
    """Messages handed over, and messages in the file after kill -9."""
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


def compare(messages: int) -> int:
    """Print the table and the results."""
    print(machine())
    print(f"{messages} messages of {len(PAYLOAD)} B on {CHANNELS} channels")
    heads = [f"us at {rate} k/s" for rate in BATCHES]
    print(f"{'writer':34} " + " ".join(f"{head:>13} {'ratio':>6}" for head in heads) + f" {'lost by kill -9':>16}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = measure_costs(folder, messages)
        for writer, costs in found.items():
            lost = _loss(writer, folder) if writer in KILLED_WRITERS else ""
            cells = " ".join(f"{cost:13.2f} {cost / ours:6.1f}" for cost, ours in zip(costs, found[OURS], strict=True))
            print(f"{writer:34} {cells} {lost:>16}".rstrip())
    return _judge(found)


def _loss(writer: str, folder: Path) -> str:
    written, found = measure_loss(writer, folder, 3.0)
    return f"{(written - found) / 2100:.2f} s"


def _judge(found: dict[str, list[float]]) -> int:
    targets = Targets()
    for position, rate in enumerate(BATCHES):
        ours, official, file = (found[name][position] for name in (OURS, OFFICIAL, FILE))
        share, multiple = ours / official, ours / file
        targets.check(f"{rate} kmsg/s: {share:.2f} x the official writer; at most 0.33", share <= MAX_OFFICIAL_RATIO)
        targets.check(
            f"{rate} kmsg/s: {multiple:.1f} x file.write; at most {MAX_FILE_RATIO:g}", multiple <= MAX_FILE_RATIO
        )
    return targets.code


def main() -> int:
    """Compare; or be the child that is killed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=210_000)
    parser.add_argument("--child", nargs=3, metavar=("WRITER", "FILE", "COUNTER"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        write_until_killed(args.child[0], Path(args.child[1]), Path(args.child[2]))
    return compare(args.messages)


if __name__ == "__main__":
    sys.exit(main())

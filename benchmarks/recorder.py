"""The recorder process under load: throughput without loss, what a message costs, and how late a stamp is.

    python benchmarks/recorder.py [--rate 200000] [--seconds 60] [--rounds 3]

Throughput: datagrams of 95 bytes to 23 links; lossless when the files hold as many of each link as were sent.
Cost: processor time of the recorder at 2.1 kmsg/s on 23 links, beside an asyncio reader that only calls ``file.write``,
in turns.  Stamps: what a datagram and a line of text on a pty were stamped with, less when they were sent, while a
process of its own computes without rest; beside an asyncio reader that takes the time in its callback.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import tty
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mcap.reader import make_reader

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.generator import HEAD, SIZE
from benchmarks.parts.machine import Verdict, cpu_s, machine, percentile
from benchmarks.parts.plain_reader import STAMPED
from benchmarks.parts.rig import RecorderRig, plain_reader, port_of, start_generator, udp_links
from fti.config import SerialLink
from fti.logger.recording import Recording

LINKS = 23
AIRCRAFT_HZ = 2100.0
MOST_COST = 1.5  # x the plain reader's
MOST_STAMP_US = 100.0
LINE_PERIOD_S = 0.005
LINE = 32  # bytes of a line on the pty
SHARES = (0.5, 0.99, 0.999)


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, default=200_000, help="messages per second, all links together")
    parser.add_argument("--seconds", type=float, default=60, help="duration of the throughput run")
    parser.add_argument("--rounds", type=int, default=3, help="turns of recorder and plain reader")
    args = parser.parse_args()
    verdict = Verdict()
    print(machine())
    with tempfile.TemporaryDirectory(prefix="fti_bench_") as name:
        folder = Path(name)
        throughput(folder / "throughput", args.rate, args.seconds, verdict)
        shutil.rmtree(folder / "throughput")
        cost(folder, args.rounds, verdict)
        stamps(folder, verdict)
    return verdict.code


def _generate(ports: Sequence[int], rate: float, seconds: float, meanwhile: Callable[[], None]) -> list[int]:
    """Have it sent; what went to each port."""
    with start_generator(ports, rate, seconds) as generator:
        while generator.poll() is None:
            meanwhile()
            time.sleep(0.05)
        assert generator.stdout
        sent: list[int] = json.loads(generator.stdout.read())["sent"]
        return sent


# ----------------------------------------------------------------------------------------------------- throughput


def throughput(folder: Path, rate: float, seconds: float, verdict: Verdict) -> None:
    """As many messages in the files as were sent."""
    links = udp_links(LINKS)
    rig = RecorderRig(folder, links)
    before, began = cpu_s(rig.pid), time.monotonic()
    sent = _generate([port_of(link) for link in links], rate, seconds, rig.listen)
    took = time.monotonic() - began
    used = cpu_s(rig.pid) - before
    rig.close()
    recorded = _recorded(rig.session.path)
    missing = sum(sent) - sum(recorded.values())
    total = sum(sent)
    print(f"throughput: {total} messages of {SIZE} B on {LINKS} links in {took:.1f} s")
    print(f"  {total / took:.0f} messages/s, {total * SIZE / took / 1e6:.1f} MB/s, recorder {100 * used / took:.0f} %")
    print(f"  of a core, {1e6 * used / total:.2f} us a message; {missing} missing")
    even = all(recorded[f"/raw/{link.name}"] == count for link, count in zip(links, sent, strict=True))
    verdict.judge(f"every message of {rate:.0f} a second for {seconds:g} s is in the files", even)


def _recorded(session: Path) -> Counter[str]:
    """Messages of each topic, as the summaries of the files tell."""
    found: Counter[str] = Counter()
    for path in sorted(session.glob("*.mcap")):
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary and summary.statistics
        for number, count in summary.statistics.channel_message_counts.items():
            found[summary.channels[number].topic] += count
    return found


# ----------------------------------------------------------------------------------------------------------- cost


def cost(folder: Path, rounds: int, verdict: Verdict, seconds: float = 15.0) -> None:
    """Processor time of both readers, in turns."""
    ours, plain = [], []
    for turn in range(rounds):
        links = udp_links(LINKS)
        rig = RecorderRig(folder / f"cost{turn}", links)
        ours.append(_cost(rig.pid, [port_of(link) for link in links], seconds, rig.listen))
        rig.close()
        with plain_reader(folder / f"plain{turn}", LINKS) as (pid, ports):
            plain.append(_cost(pid, ports, seconds, lambda: None))
    ratio = statistics.median(ours) / statistics.median(plain)
    print(f"cost at {AIRCRAFT_HZ:.0f} messages/s on {LINKS} links, median of {rounds} turns of {seconds:g} s")
    for name, shares in (("recorder", ours), ("asyncio and file.write", plain)):
        each = 1e6 * statistics.median(shares) / AIRCRAFT_HZ
        print(f"  {name:24} {100 * statistics.median(shares):5.2f} % of a core, {each:5.1f} us a message")
    verdict.judge(f"the recorder costs {ratio:.2f} x the plain reader; at most {MOST_COST}", ratio <= MOST_COST)


def _cost(pid: int, ports: Sequence[int], seconds: float, meanwhile: Callable[[], None]) -> float:
    """Share of a core while datagrams come."""
    before, began = cpu_s(pid), time.monotonic()
    _generate(ports, AIRCRAFT_HZ, seconds, meanwhile)
    return (cpu_s(pid) - before) / (time.monotonic() - began)


# --------------------------------------------------------------------------------------------------------- stamps


def stamps(folder: Path, verdict: Verdict, seconds: float = 15.0) -> None:
    """How late the stamps are while every core computes."""
    with _busy_neighbour():
        udp, serial = _our_stamps(folder, seconds)
        naive = _plain_stamps(folder / "plain", seconds)
    print(f"lateness of stamps at {AIRCRAFT_HZ:.0f} messages/s beside a busy process [us]")
    print(f"  {'':40} {'p50':>9} {'p99':>9} {'p99.9':>9}")
    rows = (("UDP, recorder (kernel stamp)", udp), ("pty, recorder (stamp at the read)", serial))
    for name, late in (*rows, ("UDP, asyncio reader that takes the time", naive)):
        late.sort()
        print(f"  {name:40} " + " ".join(f"{percentile(late, share) / 1e3:9.1f}" for share in SHARES))
    p99 = percentile(udp, 0.99) / 1e3
    verdict.judge(f"p99 of UDP stamps is {p99:.0f} us; at most {MOST_STAMP_US:.0f}", p99 <= MOST_STAMP_US)


@contextlib.contextmanager
def _busy_neighbour() -> Iterator[None]:
    """A process that never rests: the place of a navigation at full load."""
    with subprocess.Popen([sys.executable, "-c", "while True: sum(range(1000))"]) as neighbour:
        try:
            yield
        finally:
            neighbour.kill()


def _our_stamps(folder: Path, seconds: float) -> tuple[list[int], list[int]]:
    """Lateness [ns] of datagrams and of lines on a pty."""
    master, slave = os.openpty()
    tty.setraw(slave)
    links = udp_links(LINKS)
    line = SerialLink(name="line", kind="serial", port=os.ttyname(slave))
    rig = RecorderRig(folder, [*links, line])

    def write() -> None:
        rig.listen()
        for _ in range(int(0.05 / LINE_PERIOD_S)):
            os.write(master, HEAD.pack(0, time.monotonic_ns()).ljust(LINE, b"."))
            time.sleep(LINE_PERIOD_S)

    _generate([port_of(link) for link in links], AIRCRAFT_HZ, seconds, write)
    rig.close()
    os.close(master)
    os.close(slave)
    udp: list[int] = []
    serial: list[int] = []
    for frame in Recording.open(rig.session.path).frames():
        if len(frame.data) >= HEAD.size:  # not a tick
            sent = HEAD.unpack_from(frame.data)[1] + rig.epoch_ns
            (serial if frame.link == "line" else udp).append(frame.t_rx_ns - sent)
    return udp, serial


def _plain_stamps(file: Path, seconds: float) -> list[int]:
    with plain_reader(file, LINKS, "--stamp") as (_, ports):
        _generate(ports, AIRCRAFT_HZ, seconds, lambda: None)
    data = file.read_bytes()
    step = STAMPED.size + SIZE
    return [
        STAMPED.unpack_from(data, at)[0] - HEAD.unpack_from(data, at + STAMPED.size)[1]
        for at in range(0, len(data) - step + 1, step)
    ]


if __name__ == "__main__":
    sys.exit(main())

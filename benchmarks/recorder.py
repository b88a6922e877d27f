"""The whole recorder process: throughput without loss, cost, and delay of time stamps.

    python benchmarks/recorder.py [--seconds S] [--rate N] [--only throughput|calm|stamps]

throughput : datagrams of 95 B to 23 links at --rate for --seconds, from a generator on the same machine; each sent
             datagram must be in the file, and ``fti verify`` must find nothing; with [recorder] freeze_gc = true
calm       : processor time at 2100 datagrams a second on 23 links, compared with a bare asyncio reader that only calls
             ``file.write``; both get the same traffic in turn
stamps     : t_rx minus the moment of sending, UDP (the kernel's stamp) and serial (a pty), while one process computes
             in compiled code and another one in Python, so that both cores are busy; compared with a bare asyncio
             reader that takes the time in its callback

Exit code 1 when a target is missed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pty
import statistics
import struct
import sys
import tempfile
import time
import tty
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts import plain_reader as plain
from benchmarks.parts.generator import SIZE
from benchmarks.parts.machine import Targets, cpu_s, machine, percentile
from benchmarks.parts.prober import PROBE
from benchmarks.parts.processes import RecorderRig, part, plain_reader, port_of, start_generator, udp_links
from fti.config import SerialLink
from fti.logger.reading.recording import Recording
from fti.logger.verify.verification import verify

LINKS = 23
CALM_RATE, ROUNDS, MAX_CALM_RATIO = 2100.0, 7, 1.5
STAMP_RATE, MAX_STAMP_US = 1000.0, 100.0
PARTS = ("throughput", "calm", "stamps")


# ----------------------------------------------------------------------------------------------------- throughput


def throughput(folder: Path, rate: float, seconds: float, targets: Targets) -> None:
    """Everything that is sent must be in the file."""
    links = udp_links(LINKS)
    rig = RecorderRig(folder, links, freeze_gc=True)
    began = cpu_s(rig.pid)
    sent_counts, elapsed_s = feed(rig, [port_of(link) for link in links], rate, seconds)
    cpu = cpu_s(rig.pid) - began
    rig.close()
    report = verify(Recording.open(rig.session.path))
    topics = [report.topics.get(f"/raw/{link.name}") for link in links]
    recorded = [topic.messages if topic else 0 for topic in topics]
    total = sum(sent_counts)
    print(f"throughput: {LINKS} UDP links, {total} datagrams of {SIZE} B in {elapsed_s:.1f} s")
    print(f"  {total / elapsed_s:.0f} frames/s, {total * SIZE / elapsed_s / 1e6:.1f} MB/s")
    print(f"  processor time: {cpu:.1f} s, {100 * cpu / elapsed_s:.0f} % of a core, {cpu / total * 1e6:.2f} us a frame")
    targets.check(f"lossless: {sum(recorded)} of {total} recorded", recorded == sent_counts)
    targets.check(
        f"verify: {len(report.findings)} findings{''.join(f'; {f}' for f in report.findings[:2])}", report.holds
    )
    targets.check(f"at least 95 % of the requested rate ({rate:.0f}/s)", total / elapsed_s >= 0.95 * rate)


def feed(rig: RecorderRig, ports: list[int], rate: float, seconds: float) -> tuple[list[int], float]:
    """Run the generator to its end; datagrams sent to each port, and duration [s]."""
    with start_generator(ports, rate, seconds) as generator:
        while generator.poll() is None:
            rig.listen()
            time.sleep(0.05)
        assert generator.stdout
        result = json.loads(generator.stdout.read())
    return result["sent"], result["seconds"]


# ----------------------------------------------------------------------------------------------------------- calm


def calm(folder: Path, seconds: float, targets: Targets) -> None:
    """The recorder and the bare reader in turn."""
    links = udp_links(LINKS)
    rig = RecorderRig(folder, links)
    ours: list[float] = []
    bare: list[float] = []
    with plain_reader(folder / "plain", LINKS) as (pid, ports):
        for _ in range(ROUNDS):
            for shares, number, numbers in ((ours, rig.pid, [port_of(k) for k in links]), (bare, pid, ports)):
                began = cpu_s(number)
                _, elapsed_s = feed(rig, numbers, CALM_RATE, seconds)
                shares.append(100 * (cpu_s(number) - began) / elapsed_s)
    rig.close()
    ratio = statistics.median(a / b for a, b in zip(ours, bare, strict=True))
    print(f"calm: {CALM_RATE:.0f} datagrams/s of {SIZE} B on {LINKS} UDP links, {ROUNDS} rounds of {seconds:.0f} s")
    for name, shares in (("recorder", ours), ("bare reader with file.write", bare)):
        print(f"  {name:30} {statistics.median(shares):5.2f} % of a core   ({', '.join(f'{s:.2f}' for s in shares)})")
    targets.check(f"ratio in the same round, median {ratio:.2f}; at most {MAX_CALM_RATIO}", ratio <= MAX_CALM_RATIO)


# --------------------------------------------------------------------------------------------------------- stamps


@contextlib.contextmanager
def busy() -> Iterator[None]:
    """Load both cores."""
    kinds = ("arrays", "python")
    loads = [part("cpu_load", kind) for kind in kinds]
    time.sleep(1.0)
    try:
        yield
    finally:
        for load in loads:
            load.kill()
            load.wait()


def probe(ports: list[int], lines: list[int], seconds: float) -> None:
    """Send all probes."""
    ways = ["--ports", *ports, "--lines", *lines]
    with part("prober", "--rate", STAMP_RATE, "--seconds", seconds, *ways, pass_fds=lines) as prober:
        prober.wait()


def stamps(folder: Path, seconds: float, targets: Targets) -> None:
    """UDP and serial links of the recorder, then the bare reader."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    links = udp_links(4)
    line = SerialLink(name="line", kind="serial", port=os.ttyname(slave))
    rig = RecorderRig(folder, [*links, line])
    with busy():
        probe([port_of(link) for link in links], [master], seconds)
    rig.close()
    os.close(master)
    os.close(slave)
    found = delays(rig)
    print(f"stamps: {STAMP_RATE:.0f} probes/s, {seconds:.0f} s, both cores computing; later than the sending by, in us")
    print(f"  {'':40} {'p50':>8} {'p99':>8} {'p99.9':>8} {'probes':>8}")
    show("UDP, the recorder (kernel stamp)", found["udp"])
    show("serial, the recorder", found["line"])
    show("UDP, a bare reader's callback", bare_stamps(folder, seconds))
    p99 = percentile(sorted(found["udp"]), 0.99) / 1e3
    targets.check(f"UDP p99 {p99:.0f} us; at most {MAX_STAMP_US:.0f}", p99 <= MAX_STAMP_US)


def delays(rig: RecorderRig) -> dict[str, list[int]]:
    """Stamp minus sending [ns], of each datagram, and of each read of the line that begins with a probe."""
    found: dict[str, list[int]] = {"udp": [], "line": []}
    place = 0  # in the bytes of the line
    for frame in Recording.open(rig.session.path).frames():
        kind = frame.link.rstrip("0123456789")
        if len(frame.data) >= PROBE.size and place % PROBE.size == 0:
            found[kind].append(frame.t_rx_ns - rig.epoch_ns - PROBE.unpack_from(frame.data)[1])
        place += len(frame.data) if kind == "line" else 0
    return found


def show(what: str, found: list[int]) -> None:
    """A line of the table."""
    ordered = sorted(found)
    shown = " ".join(f"{percentile(ordered, share) / 1e3:8.0f}" for share in (0.5, 0.99, 0.999))
    print(f"  {what:40} {shown} {len(ordered):8}", flush=True)


def bare_stamps(folder: Path, seconds: float) -> list[int]:
    """The same with a reader that stamps in its callback."""
    path = folder / "stamped"
    with plain_reader(path, 4, "--stamp") as (_, ports), busy():
        probe(ports, [], seconds)
    data, at, found = path.read_bytes(), 0, []
    while at + plain.STAMPED.size + PROBE.size <= len(data):
        t_ns, length = plain.STAMPED.unpack_from(data, at)
        at += plain.STAMPED.size
        with contextlib.suppress(struct.error):
            found.append(t_ns - PROBE.unpack_from(data, at)[1])
        at += length
    return found


def main() -> int:
    """Run the parts, print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the throughput; the other parts take a third")
    parser.add_argument("--rate", type=float, default=200_000.0, help="datagrams per second, all links together")
    parser.add_argument("--only", choices=PARTS)
    args = parser.parse_args()
    print(machine(), flush=True)
    targets = Targets()
    for which in (args.only,) if args.only else PARTS:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            if which == "throughput":
                throughput(folder, args.rate, args.seconds, targets)
            elif which == "calm":
                calm(folder, args.seconds / 6, targets)
            else:
                stamps(folder, args.seconds / 3, targets)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())

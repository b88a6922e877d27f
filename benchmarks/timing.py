"""Lateness of the emulator and of a replay, with the recorder as their reader on the same two cores.

    python benchmarks/timing.py [--seconds S] [--only replay|devices]

replay  : a recording of serial line, UDP, slcan adapter and CAN over UDP at 2100 messages a second, ``fti replay`` at
          1x: the new recording must have the same hashes, and p99 of the lateness at most 2 ms
player  : python-can's player (``can.MessageSync``) with the frames of its slcan adapter, a second time right after;
          both latenesses on that adapter are measured when the frame is passed to the port, with the same
          scheduling priority
devices : 23 devices at the rates of table 6.1 and at four times those, ``fti hil``: each rate is held, nothing lost

"all" is every message.  Judged are those that were not due while the machine itself stood still
(``benchmarks.parts.standstill``: detected by processes that only sleep, with the highest priority), or while the
backlog of that was worked off; the share of excluded messages is printed.

Exit code 1 when a target is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import can
import numpy as np
from numpy.typing import NDArray

from benchmarks.parts.fleet import DEVICES, write_config
from benchmarks.parts.machine import Targets, machine
from benchmarks.parts.processes import ROOT, RecorderRig, port_of, udp_links
from benchmarks.parts.standstill import Standstill
from fti import config as configuration
from fti.canframe import pack_can
from fti.config import Link
from fti.hil.event_loop import realtime_priority
from fti.links.can import unpack_message
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.logger.verify.link_hash import link_hashes

LATE_LOG = [sys.executable, "-m", "benchmarks.parts.lateness_log"]

START_NS = 1_700_000_000_000_000_000
RATE_HZ, P99_MS = 2100.0, 2.0
FACTORS = (1, 4)
#: A run with a smaller judged share is repeated, at most this often.
CALM, ATTEMPTS = 0.9, 4
KINDS = {"line": "serial", "eth": "udp", "adapter": "can", "bus": "can"}


# --------------------------------------------------------------------------------------------------------- replay


def write_links(folder: Path) -> Path:
    """The configuration of the four links."""
    eth, bus = (port_of(link) for link in udp_links(2))
    ends = {
        "line": 'port = "/dev/unused"\nbaud = 921600\n',
        "eth": f'bind = "127.0.0.1:{eth}"\n',
        "adapter": 'interface = "slcan"\nchannel = "/dev/unused"\nbitrate = 500000\n',
        "bus": f'interface = "udp_multicast"\nchannel = "239.74.163.77"\nsettings = {{ port = {bus} }}\n',
    }
    links = [f'[[link]]\nname = "{name}"\nkind = "{kind}"\n{ends[name]}' for name, kind in KINDS.items()]
    file = folder / "links.toml"
    file.write_text("\n".join(['[session]\nname = "timing"\ndirectory = "unused"\n', *links]))
    return file


def make_session(folder: Path, seconds: float) -> Path:
    """A recording of them: instants of no common period."""
    rng, session = random.Random(1), SessionFolder.create(folder, "made", START_NS)
    log = RawLog(
        session, [RawTopic(name, kind, {}) for name, kind in KINDS.items()], LogSettings(split_s=300, split_mb=100)
    )
    names = list(KINDS)
    for seq, t in enumerate(sorted(rng.uniform(0.0, seconds) for _ in range(round(RATE_HZ * seconds)))):
        link = names[seq % len(names)]
        data = pack_can(rng.randrange(0x800), rng.randbytes(8)) if KINDS[link] == "can" else rng.randbytes(48)
        log.write_frame(link, seq, START_NS + round(t * 1e9), data)
        if seq % 40 == 0:
            log.flush()
    log.close()
    return session.path


def replay(folder: Path, seconds: float, targets: Targets) -> None:
    """One session through fti replay and the recorder."""
    config, original = write_links(folder), make_session(folder, seconds)
    arguments = ("replay", original, "--config", config, "--wait", 3)
    _, session, late = play_undisturbed(folder, arguments, configuration.load(config).link)
    print(f"replay: {RATE_HZ:.0f} messages/s on {', '.join(KINDS)}; {seconds:.0f} s at 1x; late by, in ms")
    show("fti replay", late)
    for name in KINDS:
        show(f"  {name}", late.of(name))
    first, second = link_hashes(Recording.open(original)), link_hashes(Recording.open(session))
    same = [name for name, found in first.items() if found.is_same(second[name])]
    targets.check(f"the same by hash: {len(same)} of {len(first)} links", len(same) == len(first))
    targets.check(f"p99 {late.p99_ms:.2f} ms; at most {P99_MS:g}", late.p99_ms <= P99_MS)
    player(original, late.of("adapter"))


@dataclass(frozen=True, eq=False)
class LatenessLog:
    """Due times and lateness of messages [s], their senders, and which ones fell into a standstill."""

    due: NDArray[np.float64]
    late: NDArray[np.float64]
    sender: NDArray[np.str_]
    exempt: NDArray[np.bool_]

    def of(self, sender: str) -> LatenessLog:
        """Those of one sender."""
        mine = self.sender == sender
        return LatenessLog(self.due[mine], self.late[mine], self.sender[mine], self.exempt[mine])

    @property
    def sent_s(self) -> NDArray[np.float64]:
        """Send times [s]."""
        return self.due + self.late

    @property
    def judged_share(self) -> float:
        """Share of the judged messages."""
        return float(np.mean(~self.exempt))

    @property
    def p99_ms(self) -> float:
        """p99 of the judged messages [ms]."""
        return 1e3 * float(np.percentile(self.late[~self.exempt], 99))


def play_undisturbed(
    folder: Path, arguments: Sequence[object], links: Sequence[Link]
) -> tuple[dict[str, Any], Path, LatenessLog]:
    """``play``, repeated where the machine stood still for most of the run."""
    for attempt in range(ATTEMPTS):
        there = folder / str(attempt)
        there.mkdir()
        played = play(there, arguments, links)
        if (share := played[2].judged_share) >= CALM:
            break
        print(f"  the machine stood still: {100 * share:.0f} % of the messages can be judged", flush=True)
    return played


def play(folder: Path, arguments: Sequence[object], links: Sequence[Link]) -> tuple[dict[str, Any], Path, LatenessLog]:
    """Run ``fti hil`` or ``fti replay`` with the recorder as its reader; its report, the recording, the log."""
    ports, report, log = folder / "ports", folder / "report.json", folder / "late.npz"
    command = [*LATE_LOG, str(log), *map(str, arguments), "--links", str(ports), "--report", str(report)]
    options: dict[str, Any] = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with Standstill() as standstill, subprocess.Popen(command, **options) as process:
        assert process.stdout
        while process.stdout.readline() not in ("ready\n", ""):
            pass
        rig = RecorderRig(folder, [set_port(link, ports) for link in links])
        while process.poll() is None:
            rig.listen()
            time.sleep(0.1)
    rig.close()
    with np.load(log) as found:
        due = found["due"]
        late = LatenessLog(due, found["late"], found["names"][found["sender"]], standstill.is_exempt(due))
    return json.loads(report.read_text()), rig.session.path, late


def set_port(link: Link, ports: Path) -> Link:
    """The link with its port in the folder."""
    key = {"serial": "port", "can": "channel"}.get(link.kind)
    here = link.kind == "serial" or (link.kind == "can" and link.interface == "slcan")
    return link.model_copy(update={key: str(ports / link.name)}) if key and here else link


def show(what: str, late: LatenessLog) -> None:
    """A line of the table."""
    p50, p99, max_ms = (1e3 * float(x) for x in (*np.percentile(late.late, (50, 99)), late.late.max()))
    print(
        f"  {what:28} all: p50 {p50:7.3f}  p99 {p99:7.3f}  max {max_ms:7.1f}"
        f"   judged {100 * late.judged_share:5.1f} %: p99 {late.p99_ms:7.3f}",
        flush=True,
    )


def player(original: Path, ours: LatenessLog) -> None:
    """The frames of the adapter by python-can's player, over its slcan and a pty that is read."""
    frames = [frame for frame in Recording.open(original).frames() if frame.link == "adapter"]
    messages = []
    for frame in frames:
        message = unpack_message(frame.data)
        message.timestamp = frame.t_rx_ns / 1e9
        messages.append(message)
    begin, late = np.nan, list[float]()
    master, slave = os.openpty()
    tty.setraw(slave)
    reading = threading.Thread(target=drain, args=(master,), daemon=True)
    reading.start()
    bus = can.Bus(os.ttyname(slave), "slcan", bitrate=500_000, sleep_after_open=0.1)
    with Standstill() as standstill, bus, realtime_priority():
        for message in can.MessageSync(messages):
            now = time.monotonic()
            begin = now if not late else begin
            late.append(now - begin - (message.timestamp - messages[0].timestamp))
            bus.send(message)
    os.close(slave)
    due = begin + np.array([message.timestamp - messages[0].timestamp for message in messages])
    theirs = LatenessLog(due, np.maximum(late, 0.0), np.full(len(late), "adapter"), standstill.is_exempt(due))
    show("python-can's player, adapter", theirs)
    print(f"  fti replay's p99 on that adapter is {ours.p99_ms / theirs.p99_ms:.2f} of the player's")


def drain(descriptor: int) -> None:
    """Read until the other end is closed."""
    try:
        while os.read(descriptor, 65536):
            pass
    except OSError:
        os.close(descriptor)


# -------------------------------------------------------------------------------------------------------- devices


def fly(folder: Path, seconds: float, factor: float, targets: Targets) -> None:
    """23 devices at a multiple of their rates."""
    config = write_config(folder, factor)
    arguments = ("hil", "nominal", "--config", config, "--wait", "--duration", seconds)
    report, session, late = play_undisturbed(folder, arguments, configuration.load(config).link)
    found = report["devices"]
    requested = sum(device["asked_hz"] for device in found.values())
    print(f"devices: {len(found)} at {factor:g} x table 6.1, {requested:.0f} cycles/s requested, {seconds:.0f} s")
    show("fti hil", late)
    p99 = {name: late.of(name).p99_ms for name in found}
    missed = [name for name, device in found.items() if p99[name] >= 0.5e3 / device["asked_hz"]]
    for name in missed:
        half_ms = 0.5e3 / found[name]["asked_hz"]
        print(f"  {name}: p99 of its lateness is {p99[name]:.2f} ms, half a period is {half_ms:.2f} ms")
    print_sent_rates(late, {name: device["asked_hz"] for name, device in found.items()})
    sent = sum(link["bytes"] for link in report["links"].values())
    recorded = link_hashes(Recording.open(session))
    targets.check(f"rates held: {len(DEVICES) - len(missed)} of {len(DEVICES)}", not missed)
    dropped = sum(link["dropped_messages"] for link in report["links"].values())
    lost = sum(report["links"][name]["bytes"] - recorded[name].bytes for name in found if kind_of(name) != "can")
    targets.check(f"{sent} bytes sent, {dropped} messages dropped, {lost} bytes not recorded", dropped == lost == 0)


def print_sent_rates(late: LatenessLog, requested_hz: dict[str, float]) -> None:
    """Print the rates at the other ends: minimum messages in a second, and longest gap, with the device."""
    sent = {name: late.of(name).sent_s for name in requested_hz}
    seconds = {name: np.histogram(t, np.arange(t[0], t[-1], 1.0))[0] for name, t in sent.items()}
    slowest = min(requested_hz, key=lambda name: seconds[name].min() / requested_hz[name])
    gap_name = max(requested_hz, key=lambda name: np.diff(sent[name]).max() * requested_hz[name])
    print(
        f"  seen at the other ends: {seconds[slowest].min()} messages in the worst second of {slowest} "
        f"({requested_hz[slowest]:g} requested); longest gap {1e3 * np.diff(sent[gap_name]).max():.1f} ms, {gap_name} "
        f"(period {1e3 / requested_hz[gap_name]:.1f} ms)"
    )


def kind_of(device: str) -> str:
    """Kind of the link of a device; of a CAN link the bytes on the line are text, and are recorded as frames."""
    return DEVICES[device].kind


def main() -> int:
    """Run the parts, print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each part")
    parser.add_argument("--only", choices=("replay", "devices"))
    args = parser.parse_args()
    print(machine(), flush=True)
    targets = Targets()
    if args.only != "devices":
        with tempfile.TemporaryDirectory() as name:
            replay(Path(name), args.seconds, targets)
    for factor in FACTORS if args.only != "replay" else ():
        with tempfile.TemporaryDirectory() as name:
            fly(Path(name), args.seconds, factor, targets)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())

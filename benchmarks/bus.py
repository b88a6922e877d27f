"""The bus inside the daemon compared with its predecessor: a zenoh router on loopback.

    python benchmarks/bus.py [--rounds N] [--seconds S]

Hub, publisher and three subscribers are processes.  Both methods take turns, in rounds, at the rate of a demonstration
and at ten times that.  A delay lasts from the call of publish to the subscriber's callback; delays of all rounds count.
"""

from __future__ import annotations

import argparse
import json
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zenoh

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, cpu_s, machine, percentile
from fti.bus.client import Publisher, Subscriber
from fti.bus.hub import Hub

RATES_HZ = (200, 2000)
SUBSCRIBERS = 3
TOPICS = 7
SIZE = 400
NAMES = {"unix": "Unix socket", "zenoh": "zenoh, router"}
STAMP = struct.Struct("<q")


# ------------------------------------------------------------------------------------------------------- processes


def zenoh_config(mode: str, listen: str | None = None, connect: str | None = None) -> Any:
    table = {
        "mode": mode,
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "listen": {"endpoints": [listen] if listen else []},
        "connect": {"endpoints": [connect] if connect else []},
        "transport": {"shared_memory": {"enabled": False}},
    }
    return zenoh.Config.from_json5(json.dumps(table))


def host(kind: str, where: str) -> None:
    """Run the hub until its input ends."""
    if kind == "unix":
        hub = Hub(Path(where), print)
        threading.Thread(target=hub.serve, daemon=True).start()
    else:
        session = zenoh.open(zenoh_config("router", listen=where))
    print("ready", flush=True)
    sys.stdin.read()
    if kind == "unix":
        hub.end()
    else:
        session.close()  # type: ignore[no-untyped-call]


def publish(kind: str, where: str, rate_hz: float, seconds: float) -> None:
    """Publish at an even rate."""
    if kind == "unix":
        put: Any = Publisher(Path(where), "navigation").publish
    else:
        session = zenoh.open(zenoh_config("client", connect=where))

        def put(topic: str, payload: bytes) -> None:
            session.put("fti/b" + topic, payload, congestion_control=zenoh.CongestionControl.DROP)

    time.sleep(1.0)  # subscriptions become known
    text = bytes(SIZE - STAMP.size)
    begin = time.monotonic()
    for i in range(round(rate_hz * seconds)):
        time.sleep(max(0.0, begin + i / rate_hz - time.monotonic()))
        put(f"/nav/{i % TOPICS}", STAMP.pack(time.monotonic_ns()) + text)
    time.sleep(0.5)


def subscribe(kind: str, where: str) -> None:
    """Subscribe until the input ends; then print the delays [ns]."""
    delays: list[int] = []

    def on_message(topic: str, payload: bytes, sent_ns: int = 0) -> None:
        delays.append(time.monotonic_ns() - STAMP.unpack_from(payload)[0])

    if kind == "unix":
        subscriber: Any = Subscriber(Path(where), "benchmark", on_message)
    else:
        subscriber = zenoh.open(zenoh_config("client", connect=where))
        subscriber.declare_subscriber("fti/b/**", lambda sample: on_message("", sample.payload.to_bytes()))
    print("ready", flush=True)
    sys.stdin.read()
    print(json.dumps(delays), flush=True)
    subscriber.close()


# ---------------------------------------------------------------------------------------------------------- rounds


@dataclass(slots=True)
class Result:
    """Totals: delays of all subscribers [ns], expected messages of one, processor time of the hub [s]."""

    delays: list[int] = field(default_factory=list)
    expected: int = 0
    hub_s: float = 0.0
    seconds: float = 0.0


def start(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, __file__, *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def await_ready(process: subprocess.Popen[str]) -> subprocess.Popen[str]:
    assert process.stdout
    assert process.stdout.readline() == "ready\n"
    return process


def run_round(kind: str, rate_hz: int, seconds: float, result: Result) -> None:
    with tempfile.TemporaryDirectory() as folder, socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
        free.close()
        where = f"{folder}/bus.sock" if kind == "unix" else f"tcp/127.0.0.1:{port}"
        hub = await_ready(start("--role", "hub", "--kind", kind, "--where", where))
        subscribers = [
            await_ready(start("--role", "subscriber", "--kind", kind, "--where", where)) for _ in range(SUBSCRIBERS)
        ]
        before = cpu_s(hub.pid)
        options = ("--rate", str(rate_hz), "--seconds", str(seconds))
        start("--role", "publisher", "--kind", kind, "--where", where, *options).communicate()
        result.hub_s += cpu_s(hub.pid) - before
        result.seconds += seconds
        for process in subscribers:
            result.delays += json.loads(process.communicate()[0])
            result.expected += round(rate_hz * seconds)
        hub.communicate()


def main() -> int:
    """Take turns, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=4.0, help="of each turn (4)")
    parser.add_argument("--role", help=argparse.SUPPRESS)
    parser.add_argument("--kind", help=argparse.SUPPRESS)
    parser.add_argument("--where", help=argparse.SUPPRESS)
    parser.add_argument("--rate", type=float, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.role == "hub":
        host(args.kind, args.where)
    elif args.role == "publisher":
        publish(args.kind, args.where, args.rate, args.seconds)
    elif args.role == "subscriber":
        subscribe(args.kind, args.where)
    return 0 if args.role else compare(args.rounds, args.seconds)


def compare(rounds: int, seconds: float) -> int:
    """Both methods, in rounds."""
    print(machine())
    results = {(rate, kind): Result() for rate in RATES_HZ for kind in NAMES}
    for _ in range(rounds):
        for (rate, kind), result in results.items():
            run_round(kind, rate, seconds, result)
    targets = Targets()
    print(f"{SUBSCRIBERS} subscribers, {SIZE} bytes a message, {rounds} rounds of {seconds:g} s each")
    for rate in RATES_HZ:
        for kind, name in NAMES.items():
            print_result(f"{rate} messages/s, {name}", results[rate, kind])
        ours, before = (percentile(sorted(results[rate, kind].delays), 0.5) for kind in ("unix", "zenoh"))
        targets.check(f"{rate} messages/s: p50 not above zenoh's", ours <= before)
        whole = results[rate, "unix"]
        targets.check(f"{rate} messages/s: every message arrived", len(whole.delays) == whole.expected)
    return targets.code


def print_result(name: str, result: Result) -> None:
    """One line."""
    ordered = sorted(result.delays)
    p50, p99 = (percentile(ordered, share) / 1e6 for share in (0.5, 0.99))
    load = 100 * result.hub_s / result.seconds
    lost = result.expected - len(ordered)
    print(f"  {name:<34} p50 {p50:5.3f}  p99 {p99:6.3f} ms  lost {lost} of {result.expected}  hub {load:4.1f} % core")


if __name__ == "__main__":
    sys.exit(main())

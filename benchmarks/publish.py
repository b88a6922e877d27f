"""Processor time and memory of all sinks at once, with their peers, beside the recording of the research aircraft.

    python benchmarks/publish.py [--duration S] [--rounds N]

The daemon records the 23 links of the soak test at the aircraft's rate (2.1 kmsg/s), in turn without [publish] and with
all its sinks, each with a connected peer: a broker with a subscriber, a router with a subscriber, a Foxglove client, an
NMEA client, and receivers of datagrams; and again while broker and router are stopped.  Peers run in processes of
their own.  Target: the publish process takes at most 10 % of a core; the other processes no more than without it, but
for the noise of the rounds.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.bus.loopback import choose_port
from tests.e2e.soak_run import Soak, run_soak
from tests.publish.broker import Broker, find_program
from tests.publish.zenoh_router import Router

MAX_CORE_PERCENT = 10.0
#: A subscriber of the router and a client of Foxglove and NMEA, each in a process of its own.
ZENOH_READER = """
import sys, json, zenoh
config = {"mode": "client", "connect": {"endpoints": [sys.argv[1]]},
          "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}}}
with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
    session.declare_subscriber("fti/**", lambda sample: None)
    sys.stdin.read()
"""
FOXGLOVE_READER = """
import asyncio, sys, aiohttp
async def main():
    async with aiohttp.ClientSession() as client:
        while True:
            try:
                async with client.ws_connect(sys.argv[1], protocols=["foxglove.sdk.v1"]) as ws:
                    async for message in ws:
                        if message.type is aiohttp.WSMsgType.TEXT and message.json().get("op") == "advertise":
                            channels = [channel["id"] for channel in message.json()["channels"]]
                            wanted = [{"id": n, "channelId": n} for n in channels]
                            await ws.send_json({"op": "subscribe", "subscriptions": wanted})
            except aiohttp.ClientError:
                await asyncio.sleep(0.5)
asyncio.run(main())
"""
NMEA_READER = """
import socket, sys, time
while True:
    try:
        with socket.create_connection(("127.0.0.1", int(sys.argv[1]))) as sock:
            while sock.recv(65536):
                pass
    except OSError:
        time.sleep(0.5)
"""


class Peers(NamedTuple):
    """publish : tables of ``[publish]``;  servers : the broker and the router"""

    publish: str
    servers: tuple[Broker, Router]


@contextlib.contextmanager
def run_peers(folder: Path) -> Iterator[Peers]:
    """Peers of every sink."""
    with contextlib.ExitStack() as stack:

        def run(*command: str) -> None:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL}
            process = stack.enter_context(subprocess.Popen(command, **pipes))  # type: ignore[call-overload]
            stack.callback(process.kill)

        broker = Broker(folder)
        stack.callback(broker.kill)
        run(find_program("mosquitto_sub", "mosquitto-clients"), "-p", str(broker.port), "-t", "fti/#")
        router = Router(f"tcp/127.0.0.1:{choose_port(0)}")
        stack.callback(router.kill)
        run(sys.executable, "-c", ZENOH_READER, router.endpoint)
        foxglove, nmea = choose_port(0), choose_port(0)
        run(sys.executable, "-c", FOXGLOVE_READER, f"ws://127.0.0.1:{foxglove}")
        run(sys.executable, "-c", NMEA_READER, str(nmea))
        receivers = [stack.enter_context(closing(socket.socket(type=socket.SOCK_DGRAM))) for _ in range(2)]
        for receiver in receivers:
            receiver.bind(("127.0.0.1", 0))
        mavlink, gdl90 = (json.dumps([f"127.0.0.1:{one.getsockname()[1]}"]) for one in receivers)
        tables = [
            "[publish.mqtt]",
            f"port = {broker.port}",
            "[publish.zenoh]",
            f'connect = "{router.endpoint}"',
            "[publish.foxglove]",
            f"port = {foxglove}",
            "[publish.nmea]",
            f"tcp_port = {nmea}",
            "[publish.mavlink]",
            f"udp = {mavlink}",
            "[publish.gdl90]",
            f"udp = {gdl90}",
        ]
        yield Peers("\n".join(tables), (broker, router))


def run_round(duration_s: float, with_sinks: bool, are_stopped: bool = False) -> Soak:
    """Record for a duration.  are_stopped : broker and router stand still from the begin of the round on"""
    with tempfile.TemporaryDirectory(prefix="fti-publish-") as folder, contextlib.ExitStack() as stack:
        if not with_sinks:
            return run_soak(Path(folder) / "soak", duration_s, 1.0)
        peers = stack.enter_context(run_peers(Path(folder)))
        stopped: list[Broker | Router] = []

        def stop_servers(line: str) -> None:
            for server in peers.servers if are_stopped and not stopped else ():
                server.pause()
                stopped.append(server)

        soak = run_soak(Path(folder) / "soak", duration_s, 1.0, stop_servers, publish=peers.publish)
        assert len(stopped) == (len(peers.servers) if are_stopped else 0)
        return soak


def report(targets: Targets, without: list[Soak], with_sinks: list[Soak], stopped: list[Soak]) -> None:
    def mean(soaks: list[Soak], name: str) -> float:
        return sum(soak.usage[name].cpu_percent for soak in soaks) / len(soaks)

    print(f"\n{'process':12} {'without':>9} {'with':>9} {'stopped':>9}   % of a core")
    for name in without[0].usage:
        print(f"{name:12} {mean(without, name):9.1f} {mean(with_sinks, name):9.1f} {mean(stopped, name):9.1f}")
    publish = mean(with_sinks, "publish")
    print(f"{'publish':12} {'':9} {publish:9.1f} {mean(stopped, 'publish'):9.1f}")
    lags = [sorted(lag for soak in soaks for lag in soak.lag_ms) for soaks in (without, with_sinks, stopped)]
    medians = " ".join(f"{lag[len(lag) // 2]:9.1f}" for lag in lags)
    print(f"{'median lag':12} {medians}   ms, of navigation\n")
    last = with_sinks[-1]
    print("sink        state          sent  replaced   skipped  lost events")
    for name, sink in last.sinks.items():
        counts = f"{sink['sent']:9d} {sink['replaced']:9d} {sink['skipped']:9d} {sink['lost_events']:12d}"
        print(f"{name:11} {sink['state']:9} {counts}")
    used = last.usage["publish"]
    middle = used.memory_mb[len(used.memory_mb) // 2]
    print(
        f"\nmemory of publish: {middle:.1f} MB in the middle of the last round, {used.memory_mb[-1]:.1f} MB at its end"
    )
    targets.check(
        f"publish takes {publish:.1f} % of a core, at most {MAX_CORE_PERCENT:g} %", publish <= MAX_CORE_PERCENT
    )
    connected = all(sink["state"] == "connected" and not sink["lost_events"] for sink in last.sinks.values())
    targets.check("every sink is connected and has lost no event", connected)
    recorded = all(not sum(soak.dropped.values()) and soak.exit_code == 0 for soak in (*with_sinks, *stopped))
    targets.check("no frame was dropped, fti verify holds", recorded)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=30.0, metavar="S", help="of each round (default: 30 s)")
    parser.add_argument("--rounds", type=int, default=2, help="(default: 2)")
    args = parser.parse_args()
    print(machine())
    print(f"{args.rounds} rounds of {args.duration:g} s each", flush=True)
    targets, without, with_sinks, stopped = Targets(), [], [], []
    for _ in range(args.rounds):
        without.append(run_round(args.duration, with_sinks=False))
        with_sinks.append(run_round(args.duration, with_sinks=True))
        stopped.append(run_round(args.duration, with_sinks=True, are_stopped=True))
    report(targets, without, with_sinks, stopped)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())

"""The research aircraft's links on loopback, fed at a multiple of its rates by a process of its own.

    python -m tests.e2e.aircraft FOLDER FACTOR

The links of ``configs/research_aircraft.toml``, serial lines and CAN adapters on ptys, and as many UDP links beside
them that there are 23, with 2.1 kmsg/s in all.  The process writes ``FOLDER/aircraft.toml`` and prints a line.  With
the first byte on its standard input it feeds, with the second it stops, and prints what it has sent: for each link
frames and bytes, as they must stand in the recording.
"""

from __future__ import annotations

import json
import os
import re
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fti.canframe import pack_can
from fti.clock import SystemClock, choose_epoch_ns
from fti.drivers.freeflight_ra4500 import Options as RadarOptions
from fti.drivers.freeflight_ra4500 import encode_height
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.drivers.imar_ixcom.solution import encode_inssol
from fti.drivers.imar_ixcom.status import HEALTHY, encode_status
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.messages.measurements import Attitude, ImuSample, Position, Stamp, Velocity
from tests.e2e.flood import free_ports, read_stdin
from tests.e2e.harness import END_S, Line
from tests.e2e.test_captures import Lawicel
from tests.helpers import ROOT

TEMPLATE = ROOT / "configs" / "research_aircraft.toml"
HOST = "127.0.78.1"
LINKS = 23
#: Messages a second of the aircraft's links; the UDP links beside them share what is left of 2100.
RATES = {
    "ins_serial": 100.0,
    "ins_ethernet": 300.0,
    "radar": 25.0,
    "laser": 9.0,
    "gnss": 10.0,
    "magnetometer": 20.0,
    "sensor_bus_1": 150.0,
    "sensor_bus_2": 150.0,
}
ALL_HZ = 2100.0
OTHERS = [f"other_{n}" for n in range(LINKS - len(RATES))]
OTHER_HZ = (ALL_HZ - sum(RATES.values())) / len(OTHERS)
PERIOD_S = 0.001
GPS_EPOCH_NS = 315_964_800 * 10**9
FILLING = bytes(range(48))
#: Carries bytes to the daemon; the number and the bytes of frames, as they will be recorded.
Send = Callable[[bytes], None]


class Aircraft:
    """The process; ``sent`` tells of each link (frames, bytes) when it has been stopped."""

    def __init__(self, folder: Path, factor: float) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.config = folder / "aircraft.toml"
        self.links = folder
        self.sent: dict[str, tuple[int, int]] = {}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.e2e.aircraft", str(folder), str(factor)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        assert self._process.stdout
        self._process.stdout.readline()

    def start(self) -> None:
        """Begin to feed."""
        self._command()

    def stop(self) -> None:
        """Stop feeding; the lines stay until ``close``."""
        self._command()
        assert self._process.stdout
        self.sent = {
            name: (frames, size) for name, (frames, size) in json.loads(self._process.stdout.readline()).items()
        }

    def _command(self) -> None:
        assert self._process.stdin
        self._process.stdin.write(".")
        self._process.stdin.flush()

    def close(self) -> None:
        """End the process, and the lines with it."""
        self._process.communicate(timeout=END_S)


# ------------------------------------------------------------------------------------------------ in the process


@dataclass(slots=True)
class Source:
    """One link: its rate [Hz], makes the n-th message at a GPS time, sends it; so many bytes of it are recorded."""

    rate_hz: float
    make: Callable[[int, int], bytes]
    send: Send
    recorded_bytes: Callable[[bytes], int] = len
    frames: int = 0
    bytes: int = 0

    def catch_up(self, elapsed_s: float, t_gps_ns: int) -> None:
        """Send what is due."""
        due = int(elapsed_s * self.rate_hz)
        while self.frames < due:
            data = self.make(self.frames, t_gps_ns)
            self.send(data)
            self.frames += 1
            self.bytes += self.recorded_bytes(data)


def _ins(number: int, t_gps_ns: int) -> bytes:
    return encode_frame(NUMBERS["INSSOL"], number, t_gps_ns, encode_status(HEALTHY), _SOLUTION)


_AT = Stamp(0)
_SOLUTION = encode_inssol(
    ImuSample(stamp=_AT, accel_b=(0.0, 0.0, -9.8), gyro_b=(0.0, 0.0, 0.0)),
    Attitude(stamp=_AT, roll=0.0, pitch=0.02, heading=1.5),
    Velocity(stamp=_AT, north=3.0, east=60.0, down=0.0),
    Position(stamp=_AT, lat=0.84, lon=0.19, alt=900.0),
)


def _radar(number: int, t_gps_ns: int) -> bytes:
    return encode_height(100.0 + number % 100, (), RadarOptions())


def _text(number: int, t_gps_ns: int) -> bytes:
    return b"$%012d,%019d\r\n" % (number, t_gps_ns)


def _can(number: int, t_gps_ns: int) -> bytes:
    return b"t%03X8%016X\r" % (300 + number % 30, number)


def _datagram(number: int, t_gps_ns: int) -> bytes:
    return struct.pack("<QQ", number, t_gps_ns) + FILLING


MAKE = {"ins_serial": _ins, "ins_ethernet": _ins, "radar": _radar, "sensor_bus_1": _can, "sensor_bus_2": _can}
CAN_FRAME_BYTES = len(pack_can(0, b""))


def _configure(ports: dict[str, int]) -> str:
    """The aircraft's configuration on loopback, and the links that it does not name."""
    text = TEMPLATE.read_text()
    text = re.sub(r'bind = "[^"]*"', f'bind = "{HOST}:{ports["ins_ethernet"]}"', text)
    text = re.sub(r'source = "[^"]*"', 'source = "127.0.0.1"', text)
    text = text.replace('"socketcan"', '"slcan"').replace('"calibrations/', f'"{TEMPLATE.parent}/calibrations/')
    others = [f'[[link]]\nname = "{n}"\nkind = "udp"\nbind = "{HOST}:{ports[n]}"\n' for n in OTHERS]
    return "\n".join([text, *others, "[display]\nport = 0\n"])


def _sources(folder: Path, ports: dict[str, int], sock: socket.socket) -> tuple[dict[str, Source], list[Lawicel]]:
    sources, adapters = {}, []
    for name, rate in [*RATES.items(), *((name, OTHER_HZ) for name in OTHERS)]:
        if name in ports:
            make = MAKE.get(name, _datagram)
            sources[name] = Source(rate, make, _to_port(sock, ports[name]))
            continue
        line = Line(folder / name)
        make = MAKE.get(name, _text)
        if make is _can:
            adapters.append(Lawicel(line))
            sources[name] = Source(rate, make, line.write, lambda data: CAN_FRAME_BYTES)
        else:
            sources[name] = Source(rate, make, line.write)
    return sources, adapters


def _to_port(sock: socket.socket, port: int) -> Send:
    def send(data: bytes) -> None:
        sock.sendto(data, (HOST, port))

    return send


def _feed(folder: Path, factor: float) -> None:
    names = ["ins_ethernet", *OTHERS]
    ports = dict(zip(names, free_ports(HOST, len(names)), strict=True))
    (folder / "aircraft.toml").write_text(_configure(ports))
    clock = SystemClock(choose_epoch_ns())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sources, adapters = _sources(folder, ports, sock)
        print("ready", flush=True)
        while read_stdin() is None:
            _answer_adapters(adapters)
        begin = time.monotonic()
        while read_stdin() is None:
            _answer_adapters(adapters)
            elapsed, t_gps_ns = (time.monotonic() - begin) * factor, clock.now_ns() - GPS_EPOCH_NS
            for source in sources.values():
                source.catch_up(elapsed, t_gps_ns)
        print(json.dumps({name: (source.frames, source.bytes) for name, source in sources.items()}), flush=True)
        while read_stdin() is None:
            _answer_adapters(adapters)


def _answer_adapters(adapters: list[Lawicel]) -> None:
    """Answer the CAN links, also when they open again."""
    for adapter in adapters:
        adapter.answer()
    time.sleep(PERIOD_S)


if __name__ == "__main__":
    os.set_blocking(0, False)
    _feed(Path(sys.argv[1]), float(sys.argv[2]))

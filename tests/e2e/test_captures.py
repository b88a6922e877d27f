"""Real captures through real transports: what went in is in the file, byte for byte, however it was cut."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fti.canframe import pack_can
from fti.logger.reading.recording import Recording
from tests.e2e.harness import Daemon, Line, daemon, free_udp_port
from tests.helpers import ROOT, until

pytestmark = pytest.mark.timeout(900)
CAPTURES = ROOT / "tests" / "captures"
CAN_LOG = CAPTURES / "nmea2000_part1.candump.log"
FILES = sorted(p for p in CAPTURES.iterdir() if p.suffix in (".log", ".gps") and p != CAN_LOG)
#: The largest datagram that Ethernet carries whole, a short one, and cuts by chance.
CUTS = {"large": (1400, 1400), "small": (97, 97), "random": (1, 700)}


def chunks(data: bytes, cut: str) -> list[bytes]:
    """The data in pieces; the same for the same cut."""
    rng = random.Random(cut)
    smallest, largest = CUTS[cut]
    pieces, at = [], 0
    while at < len(data):
        size = rng.randint(smallest, largest)
        pieces.append(data[at : at + size])
        at += size
    return pieces


def _link_name(kind: str, path: Path, cut: str) -> str:
    return f"{kind}_{cut}_{path.stem}".lower().replace("-", "_").replace(".", "_")


def _config(ports: dict[str, int], serial: list[str]) -> str:
    links = [f'[[link]]\nname = "{name}"\nkind = "serial"\nport = "/dev/unused"\n' for name in serial]
    links += [f'[[link]]\nname = "{name}"\nkind = "udp"\nbind = "127.0.0.1:{port}"\n' for name, port in ports.items()]
    can = '[[link]]\nname = "bus"\nkind = "can"\ninterface = "slcan"\nchannel = "/dev/unused"\nbitrate = 250000\n'
    head = '[session]\nname = "captures"\ndirectory = "unused"\nmin_free_mb = 10\n[display]\nenabled = false\n'
    return "\n".join([head, *links, can])


def candump_frames() -> Iterator[tuple[int, bytes]]:
    """Identifier and data of each frame of the log (``(time) can0 ID#DATA``)."""
    for line in CAN_LOG.read_text().splitlines():
        if line and not line.startswith("#"):
            can_id, _, data = line.split()[2].partition("#")
            yield int(can_id, 16), bytes.fromhex(data)


class Lawicel:
    """A CAN adapter on a pty that answers every command and then sends the frames of the log."""

    def __init__(self, line: Line) -> None:
        self.line = line
        self.opened = threading.Event()

    def answer(self) -> bool:
        """Acknowledge what has been said; true once the bus was opened."""
        commands = self.line.read()
        for command in commands.split(b"\r")[:-1]:
            self.line.write(b"\r")
            if command.startswith(b"O"):
                self.opened.set()
        return self.opened.is_set()

    def send_log(self) -> None:
        """Send every frame once."""
        for can_id, data in candump_frames():
            self.line.write(b"T%08X%d%s\r" % (can_id, len(data), data.hex().upper().encode()))


def _wait_until_open(running: Daemon, count: int) -> None:
    def opened() -> bool:
        states = [link["state"] for link in running.health().get("links", {}).values()]
        return states.count("silent") == count

    until(opened, what=f"{count} open links")


def _send_slowly(port: int, pieces: list[bytes]) -> None:
    """Faster than any sensor, slower than a socket that nobody could empty."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for i, piece in enumerate(pieces):
            sock.sendto(piece, ("127.0.0.1", port))
            if i % 20 == 19:
                time.sleep(0.01)


def test_every_capture_is_recorded_byte_for_byte(tmp_path: Path) -> None:
    assert len(FILES) == 8
    serial = {_link_name("tty", path, cut): chunks(path.read_bytes(), cut) for path in FILES for cut in CUTS}
    udp = {_link_name("udp", path, cut): chunks(path.read_bytes(), cut) for path in FILES for cut in CUTS}
    ports = {name: free_udp_port() for name in udp}
    config = tmp_path / "captures.toml"
    config.write_text(_config(ports, list(serial)))
    links = tmp_path / "links"
    links.mkdir()
    lines = {name: Line(links / name) for name in serial}
    adapter = Lawicel(Line(links / "bus"))
    try:
        with daemon(config, tmp_path / "out", "--links", str(links)) as running:
            session = running.session
            until(adapter.answer, what="an open bus")
            _wait_until_open(running, len(serial) + len(udp) + 1)
            _at_once(lambda: _play_lines(lines, serial), lambda: _play_datagrams(ports, udp), adapter.send_log)
            running.stop()
    finally:
        for line in (*lines.values(), adapter.line):
            line.close()
    recorded = _recorded(session)
    for name, pieces in serial.items():
        assert b"".join(recorded[name]) == b"".join(pieces), name
    for name, pieces in udp.items():
        assert recorded[name] == pieces, name
    assert recorded["bus"] == [pack_can(i, data, extended=True) for i, data in candump_frames()]


def _play_lines(lines: dict[str, Line], pieces: dict[str, list[bytes]]) -> None:
    for name, line in lines.items():
        for piece in pieces[name]:
            line.write(piece)


def _play_datagrams(ports: dict[str, int], pieces: dict[str, list[bytes]]) -> None:
    for name, port in ports.items():
        _send_slowly(port, pieces[name])


def _at_once(*jobs: Callable[[], None]) -> None:
    """Run the jobs side by side; a failure of one is raised."""
    with ThreadPoolExecutor(len(jobs)) as pool:
        for done in [pool.submit(job) for job in jobs]:
            done.result()


def _recorded(session: Path) -> dict[str, list[bytes]]:
    data: dict[str, list[bytes]] = {}
    for frame in Recording.open(session).frames():
        data.setdefault(frame.link, []).append(frame.data)
    return data

"""``fti listen``: bytes with times, and who understands them."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.canframe import pack_can
from fti.cli.listen import frame_lines
from fti.cli.main import main
from fti.drivers.freeflight_ra4500 import Options, encode_height
from tests.helpers import ROOT, until
from tests.links.bench import Peer

FRAME = encode_height(100.0, ("in_air",), Options())
CONFIG = """
[session]
name = "bench"

[[link]]
name = "radalt_line"
kind = "serial"
port = "{port}"
baud = 57600
transmit = true
"""


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    line_peer = Peer(tmp_path / "line")
    yield line_peer
    line_peer.power_off()


class Listening:
    """The command as a process, its output in files."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.out, self.err = folder / "out", folder / "err"
        with self.out.open("wb") as out, self.err.open("wb") as err:
            command = [sys.executable, "-m", "fti.cli.main", "listen", *arguments]
            self.process = subprocess.Popen(command, stdout=out, stderr=err, cwd=ROOT)

    def interrupt(self) -> int:
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(120)


def test_port_that_talks_is_shown_and_understood(peer: Peer, tmp_path: Path) -> None:
    peer.write(FRAME * 3 + b"\x01\x02AB")
    command = Listening(tmp_path, str(peer.path))
    until(lambda: "freeflight_ra4500: 3 messages, 27 of 31 bytes" in command.err.read_text())
    assert command.interrupt() == 130
    first, second = command.out.read_text().splitlines()
    assert re.match(rf" +\d+\.\d{{6}}  {FRAME.hex(' ')} {FRAME[:7].hex(' ')} +\.", first)
    assert second.endswith("....AB")
    assert "1 frames, 31 bytes" in command.err.read_text()


def test_link_of_a_configuration_is_listened_to_and_nothing_is_sent(peer: Peer, tmp_path: Path) -> None:
    config = tmp_path / "bench.toml"
    config.write_text(CONFIG.format(port=peer.path))
    peer.write(b"hello")
    command = Listening(tmp_path, "radalt_line", "--config", str(config), "--baud", "9600", "--duration", "1.5")
    assert command.process.wait(120) == 0
    assert command.out.read_text().endswith("hello\n")
    assert peer.read() == b""


def test_datagrams(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
        device.bind(("127.0.0.1", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            place = free.getsockname()
        command = Listening(tmp_path, f"127.0.0.1:{place[1]}")

        def has_output() -> bool:
            device.sendto(FRAME, place)
            return "freeflight_ra4500" in command.err.read_text()

        until(has_output)
        assert command.interrupt() == 130
    assert FRAME.hex(" ") in command.out.read_text()


def test_can_frames_are_shown_as_identifier_and_data() -> None:
    assert frame_lines(pack_can(0x123, b"\x01\xab"), "can") == ["     123  [2]  01 ab"]
    assert frame_lines(pack_can(0x123, b"\0\0", extended=True, remote=True), "can") == ["00000123  [2]  00 00  remote"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["/dev/ttyNOTHING"], "no such port; present:"),
        (["nothing"], "for a link give --config"),
        (["nothing", "--config", "CONFIG"], "no link 'nothing'; configured: radalt_line"),
        (["127.0.0.1:70000"], "allowed is 0 to 65535"),
        (["192.0.2.1:4000"], "not an address of this machine"),
        (["x:y"], "link"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "bench.toml"
    config.write_text(CONFIG.format(port="/dev/ttyUSB0"))
    assert main(["listen", *[str(config) if a == "CONFIG" else a for a in arguments]]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert len(error.splitlines()) == 1


def test_a_baud_rate_that_no_line_has(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["listen", "/dev/ttyS0", "--baud", "0"])
    assert "--baud: '0': must be a whole number from 50 to 100000000" in capsys.readouterr().err

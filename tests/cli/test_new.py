"""``fti new``: from the bytes on the ports to a configuration that ``fti check`` accepts."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti import config as configuration
from fti.cli._new_config import Answers, config_text, name_ports
from fti.cli._port_survey import FoundDevice, FoundPort
from fti.cli.main import main
from fti.messages.measurements import Attitude, Position, RadioHeight, Range
from tests.helpers import TIMEOUT_S

PERIOD_S = 0.05
NMEA = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"


@contextlib.contextmanager
def sending(link: Path, data: bytes) -> Iterator[None]:
    """A device on a pty that sends the same bytes 20 times a second."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    link.symlink_to(os.ttyname(slave))
    os.close(slave)  # a port that a program has open is busy
    ended = threading.Event()

    def send() -> None:
        while not ended.wait(PERIOD_S):
            with contextlib.suppress(OSError):  # full, or without reader
                os.write(master, data)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        os.close(master)


def test_what_sends_becomes_a_device_and_the_rest_a_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ports, file = tmp_path / "links", tmp_path / "own.toml"
    ports.mkdir()
    with sending(ports / "gnss_line", NMEA), sending(ports / "spare_line", b"?"), socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
        arguments = ("--links", str(ports), "--udp", address, "--seconds", "1.5")
        assert main(["new", str(file), *arguments]) == 0
    printed = capsys.readouterr()
    assert f"{file}: 1 device; next: fti check {file}" in printed.out
    assert f"{address}: no bytes" in printed.err
    config = configuration.load(file)
    assert [(link.name, link.kind) for link in config.link][:2] == [("gnss_line", "serial"), ("spare_line", "serial")]
    (device,) = config.device
    assert (device.name, device.link, device.driver) == ("gnss", "gnss_line", "nmea0183")
    assert device.rate_hz == pytest.approx(1 / PERIOD_S, rel=0.3)
    assert config.nav.position == ("gnss",)
    assert "which no driver decodes" in file.read_text()
    assert main(["check", str(file)]) == 0


@contextlib.contextmanager
def on_a_terminal(*arguments: str) -> Iterator[tuple[int, subprocess.Popen[bytes]]]:
    """``fti`` on a terminal of its own: the person's end, and the process."""
    person, terminal = os.openpty()
    process = subprocess.Popen(
        ["setsid", "--ctty", "--wait", sys.executable, "-m", "fti.cli.main", *arguments],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
    )
    os.close(terminal)
    try:
        yield person, process
    finally:
        process.kill()
        process.wait()
        os.close(person)


def read_until(person: int, text: str) -> str:
    """What the command prints until text."""
    printed = ""
    while text not in printed:
        part = os.read(person, 4096)
        assert part, printed
        printed += part.decode()
    return printed


@pytest.mark.timeout(120)
def test_on_a_terminal_it_asks_what_it_cannot_know(tmp_path: Path) -> None:
    """A wrong answer is asked for again; Enter takes the default."""
    ports, file = tmp_path / "links", tmp_path / "My plane.toml"
    ports.mkdir()
    questions = (
        ("Name of the aircraft [my_plane]: ", "D-XY"),
        ("'D-XY': must be lower-case letters, digits and _, a letter first", "dxy"),
        ("CAN adapters [none]: ", ""),
        ("UDP addresses to listen on, such as 192.168.10.1:4000 [none]: ", "here"),
        ("'here': must be ADDRESS:PORT", ""),
        ("Devices of position, first the preferred one [one two]: ", "two one"),
        ("one: from the reference point to the sensor, forward right down [m] [unknown]: ", "0.5 0 -1.25"),
        ("two: from the reference point to the sensor, forward right down [m] [unknown]: ", ""),
    )
    arguments = ("new", str(file), "--links", str(ports), "--seconds", "3")
    with (
        sending(ports / "one_line", NMEA),
        sending(ports / "two_line", NMEA),
        on_a_terminal(*arguments) as (person, process),
    ):
        for question, answer in questions:
            read_until(person, question)
            os.write(person, f"{answer}\n".encode())
        assert process.wait(TIMEOUT_S) == 0
    config = configuration.load(file)
    assert config.session.name == "dxy"
    assert config.nav.position == ("two", "one")
    assert [device.lever_arm_b for device in config.device] == [(0.5, 0.0, -1.25), (0.0, 0.0, 0.0)]
    arms = [line for line in file.read_text().splitlines() if line.startswith("lever_arm_b")]
    assert ["CHECK" in line for line in arms] == [False, True]


def test_a_name_that_no_session_may_have_is_refused_before_listening(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["new", str(tmp_path / "own.toml"), "--name", "D-XY"])
    assert "--name: 'D-XY': must be lower-case letters" in capsys.readouterr().err


def test_a_used_port_is_skipped_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A used address is named once; without any data there is no file."""
    ports, file = tmp_path / "links", tmp_path / "own.toml"
    ports.mkdir()
    with sending(ports / "used_line", NMEA), socket.socket(type=socket.SOCK_DGRAM) as used:
        used.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{used.getsockname()[1]}"
        with (
            (ports / "used_line").open("rb", buffering=0) as line,
            subprocess.Popen(["sleep", "60"], stdin=line) as reader,
        ):
            assert main(["new", str(file), "--links", str(ports), "--udp", address, "--seconds", "0.5"]) == 1
            reader.kill()
    printed = capsys.readouterr().err.splitlines()
    assert printed[0] == f"{ports}/used_line: skipped, busy (in use by sleep (process {reader.pid}))"
    assert printed[1].startswith("listening on 1 port, ")
    assert f"{address}: in use by another program" in printed
    assert printed[-1].startswith("fti: no data on any port: ")
    assert not file.exists()


def test_a_used_address_and_a_high_rate_in_the_file(tmp_path: Path) -> None:
    device = FoundDevice("nmea0183", 1.0, 233.0, frozenset({Position}))
    used = FoundPort({"kind": "udp", "bind": "127.0.0.1:4001"}, 0, fault="in use", is_busy=True)
    found = FoundPort({"kind": "udp", "bind": "127.0.0.1:4002"}, 100, device)
    text = config_text(tmp_path / "own.toml", "own", name_ports([used, found]), Answers())
    assert "# the address was in use: " in text
    assert "rate_hz = 230  #" in text


def test_a_file_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own.toml").write_text("mine")
    with pytest.raises(SystemExit):
        main(["new", str(tmp_path / "own.toml")])
    assert "already exists" in capsys.readouterr().err
    assert (tmp_path / "own.toml").read_text() == "mine"


def test_without_a_port_the_remedy_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "links").mkdir()
    assert main(["new", str(tmp_path / "own.toml"), "--links", str(tmp_path / "links")]) == 2
    assert "--udp" in capsys.readouterr().err


def test_roles_begin_with_the_device_that_has_most(tmp_path: Path) -> None:
    def udp(port: int, driver: str, *kinds: type) -> FoundPort:
        device = FoundDevice(driver, 1.0, 10.0, frozenset(kinds))
        return FoundPort({"kind": "udp", "bind": f"127.0.0.1:{port}"}, 100, device)

    ports = [
        udp(4001, "nmea0183", Position),
        udp(4002, "imar_ixcom", Position, Attitude),
        udp(4003, "lightware_ascii", Range),
        udp(4004, "freeflight_ra4500", RadioHeight),
        udp(4005, "nmea0183", Position),
    ]
    file = tmp_path / "own.toml"
    file.write_text(config_text(file, "own", name_ports(ports), Answers()))
    config = configuration.load(file)
    names = [device.name for device in config.device]
    assert len({*names}) == 5
    assert config.nav.position == (names[1], names[0], names[4])
    assert config.nav.attitude == ("imar_ixcom",)
    assert config.nav.altimeters == ("lightware_ascii", "freeflight_ra4500")
    kinds = {device.name: device.altimeter.kind for device in config.device if device.altimeter}
    assert kinds == {"lightware_ascii": "laser", "freeflight_ra4500": "radar"}

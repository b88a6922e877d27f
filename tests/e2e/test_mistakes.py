"""What goes wrong on a bench: wrong cable, wrong port, wrong file.  Each is a clear sentence."""

from __future__ import annotations

import json
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import serial

from fti.cli.main import main
from fti.drivers import freeflight_ra4500
from tests.e2e.harness import Daemon, Line, daemon, fti
from tests.helpers import ROOT, until

pytestmark = pytest.mark.timeout(900)

CONFIG = """
[session]
name = "bench"
directory = "out"
min_free_mb = 10

[[link]]
name = "line"
kind = "serial"
port = "line"

[[device]]
name = "altimeter"
link = "line"
driver = "freeflight_ra4500"
rate_hz = 25
max_age_ms = 500

[display]
enabled = false
"""
NMEA = (ROOT / "tests" / "captures" / "ublox-8.log").read_bytes()


class Chatter:
    """Repeats bytes on a line until it is stopped."""

    def __init__(self, line: Line, data: bytes, period_s: float) -> None:
        self._line, self._data, self._period = line, data, period_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="chatter")

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(self._period):
            self._line.write(self._data)


def _device(running: Daemon) -> dict[str, Any]:
    content: dict[str, Any] = running.health().get("devices", {}).get("altimeter", {})
    return content


def _hint_on(tmp_path: Path, data: bytes, period_s: float, state: str) -> str:
    """What the daemon says of a line on which these bytes come."""
    (tmp_path / "links").mkdir()
    line = Line(tmp_path / "links" / "line")
    (tmp_path / "bench.toml").write_text(CONFIG)
    try:
        with daemon(tmp_path / "bench.toml", tmp_path / "out", "--links", str(tmp_path / "links")) as running:
            with Chatter(line, data, period_s):
                until(lambda: _device(running).get("state") == state, what=f"the state {state}")
                hint = until(lambda: _device(running).get("hint"), what="a hint")
            running.stop()
    finally:
        line.close()
    return str(hint)


def test_the_wrong_device_is_recognised(tmp_path: Path) -> None:
    lines = NMEA.splitlines(keepends=True)
    sentences = b"".join(line for line in lines if line.startswith(b"$"))[:2000]
    sentences = sentences[: sentences.rindex(b"\n") + 1]
    (tmp_path / "links").mkdir()
    line = Line(tmp_path / "links" / "line")
    (tmp_path / "bench.toml").write_text(CONFIG)
    try:
        with daemon(tmp_path / "bench.toml", tmp_path / "out", "--links", str(tmp_path / "links")) as running:
            with Chatter(line, sentences, 0.2):
                until(lambda: "nmea0183" in str(_device(running).get("hint")), what="the right driver named")
                assert _device(running)["state"] == "noise"
            running.stop()
    finally:
        line.close()


def test_the_wrong_baud_rate_is_noise(tmp_path: Path) -> None:
    garbage = bytes((i * 37 + 11) % 251 for i in range(300)).replace(b"\x10", b"\x11")
    assert "baud" in _hint_on(tmp_path, garbage, 0.1, "noise")


def test_a_line_with_damaged_bytes_is_invalid(tmp_path: Path) -> None:
    frame = freeflight_ra4500.encode_height(100.0, (), freeflight_ra4500.Options())
    assert "damaged" in _hint_on(tmp_path, frame + frame[:-1] + b"\x55", 0.04, "invalid")


def test_a_wrong_rate_is_reported(tmp_path: Path) -> None:
    frame = freeflight_ra4500.encode_height(100.0, (), freeflight_ra4500.Options())
    assert "rate_hz = 25" in _hint_on(tmp_path, frame, 0.2, "wrong rate")


def test_a_silent_line_is_reported(tmp_path: Path) -> None:
    frame = freeflight_ra4500.encode_height(100.0, (), freeflight_ra4500.Options())
    assert "power" in _hint_on(tmp_path, frame, 1000.0, "silent")


def test_a_missing_port_is_reported_and_found_when_it_comes(tmp_path: Path) -> None:
    links = tmp_path / "links"
    links.mkdir()
    (tmp_path / "bench.toml").write_text(CONFIG)
    with daemon(tmp_path / "bench.toml", tmp_path / "out", "--links", str(links)) as running:
        link = until(lambda: running.health()["links"].get("line"), what="the link's health")
        assert link["state"] == "absent"
        assert str(links / "line") in link["hint"]
        line = Line(links / "line")
        until(lambda: running.health()["links"]["line"]["state"] == "silent", what="the port found")
        running.stop()
    line.close()


def test_a_port_in_use_is_reported(tmp_path: Path) -> None:
    links = tmp_path / "links"
    links.mkdir()
    line = Line(links / "line")
    (tmp_path / "bench.toml").write_text(CONFIG)
    with (
        serial.Serial(str(links / "line"), exclusive=True),
        daemon(tmp_path / "bench.toml", tmp_path / "out", "--links", str(links)) as running,
    ):
        until(lambda: running.health()["links"].get("line", {}).get("state") == "busy", what="the state busy")
        running.stop()
    line.close()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('port = "line"', 'prot = "line"', "link[0].prot"),
        ("rate_hz = 25", 'rate_hz = "fast"', "device[0].rate_hz = 'fast'"),
        ('link = "line"', 'link = "lime"', "device[0].link = 'lime'"),
        ('"freeflight_ra4500"', '"freeflight_ra4501"', "freeflight_ra4500"),
        ("max_age_ms = 500", 'options = { checksum = "md5" }', "device[0].options.checksum = 'md5'"),
        ('name = "bench"', 'name = "Bench 1"', "session.name = 'Bench 1'"),
        ("[session]", "[session", "is not valid TOML"),
    ],
)
def test_a_mistake_in_the_configuration_is_one_sentence(
    tmp_path: Path, old: str, new: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "bench.toml"
    config.write_text(CONFIG.replace(old, new, 1))
    for command in ("run", "check"):
        code, printed = main([command, str(config)]), capsys.readouterr().err
        assert code == 2
        assert printed.startswith("fti: ")
        assert str(config) in printed
        assert message in printed
        assert printed.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_missing_configuration_and_a_wrong_dbc(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
    (tmp_path / "air.dbc").write_text("BO_ this is no DBC")
    config = tmp_path / "can.toml"
    config.write_text(
        CONFIG.replace('kind = "serial"\nport = "line"', 'kind = "can"\ninterface = "slcan"\nchannel = "line"')
        .replace("freeflight_ra4500", "canaerospace")
        .replace("max_age_ms = 500", 'options = { dbc_file = "air.dbc" }')
    )
    assert main(["run", str(config)]) == 2
    printed = capsys.readouterr().err
    assert "device[0].options" in printed
    assert "line 1" in printed or ":1" in printed


def test_a_directory_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(CONFIG)
    (tmp_path / "file").write_text("")
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    places = [tmp_path / "file", Path("/proc")] + ([] if os.getuid() == 0 else [locked])
    for place in places:
        done = fti("run", str(tmp_path / "bench.toml"), "--out", str(place))
        assert done.returncode == 2, done.stdout + done.stderr
        assert str(place) in done.stderr
        assert "Traceback" not in done.stderr


def test_a_look_at_the_links_reports_the_states_of_the_daemon(tmp_path: Path) -> None:
    empty, links = tmp_path / "empty", tmp_path / "links"
    links.mkdir()
    (tmp_path / "bench.toml").write_text(CONFIG)
    look = ("check", str(tmp_path / "bench.toml"), "--live", "--json", "--links")
    line = Line(links / "line")
    frame = freeflight_ra4500.encode_height(100.0, (), freeflight_ra4500.Options())
    with Chatter(line, frame, 0.04), ThreadPoolExecutor(2) as pool:
        without, found = pool.map(lambda folder: fti(*look, str(folder)), (empty, links))
    line.close()
    assert without.returncode == 1
    assert json.loads(without.stdout)["live"]["line"]["state"] == "absent"
    live = json.loads(found.stdout)["live"]["line"]
    assert live["state"] == "good", live
    assert live["bytes"] > 50 * len(frame)
    assert found.returncode == 0

"""A recorded flight again: its bytes through a replay."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from fti.logger.reading.recording import Recording
from tests.e2e.flights import DEMO, fly_faster
from tests.e2e.harness import END_S, FTI, START_S, daemon, with_free_ports
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(300)]
FLIGHT_S, SPEED = 48.0, 3.0


def _frames(session: Path) -> dict[str, list[bytes]]:
    data: dict[str, list[bytes]] = {}
    for frame in Recording.open(session).frames():
        data.setdefault(frame.link, []).append(frame.data)
    return data


def test_recording_a_replay_gives_the_same_bytes(tmp_path: Path) -> None:
    original = fly_faster("altimeter_failure", tmp_path / "original", FLIGHT_S).session
    config = tmp_path / "demo.toml"
    config.write_text(with_free_ports(DEMO.read_text()).replace('"profiles/', f'"{DEMO.parent}/profiles/'))
    links = tmp_path / "links"
    arguments = ("--config", str(config), "--links", str(links), "--speed", str(SPEED))
    with subprocess.Popen([*FTI, "replay", str(original), *arguments], stdout=subprocess.PIPE, text=True) as replay:
        until(lambda: links.is_dir() or replay.poll() is not None, START_S, "the replay's ports")
        with daemon(config, tmp_path / "out", "--links", str(links), "--origin", "replay") as running:
            session = running.session
            replay.communicate(timeout=END_S)
            assert replay.returncode == 0
            running.stop()
    first, again = _frames(original), _frames(session)
    first.pop("fti_tick"), again.pop("fti_tick")
    assert first.keys() == again.keys()
    for link, kind in Recording.open(original).links.items():
        if kind == "serial":
            assert b"".join(again[link]) == b"".join(first[link]), link
        else:
            assert again[link] == first[link], link
    assert Recording.open(session).metadata["fti"]["origin"] == "replay"

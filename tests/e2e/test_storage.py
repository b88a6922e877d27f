"""Media that are full, frozen, broken, taken away and put back, on real mounts: every fed byte is in the files."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fti.logger.reading.recording import Recording
from tests.e2e.feeder import Feeder
from tests.e2e.harness import Daemon, daemon, fti
from tests.e2e.mounts import Ext4, Tmpfs, mounted, skip_unless_possible
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]


@pytest.fixture
def feeder(tmp_path: Path) -> Iterator[Feeder]:
    skip_unless_possible()
    with Feeder(tmp_path / "links") as new_feeder:
        yield new_feeder


def configure(feeder: Feeder, fallback: Path | None = None) -> None:
    """Little space is enough; no page; perhaps a fallback."""
    text = feeder.config.read_text().replace("min_free_mb = 10", "min_free_mb = 1")
    text = text.replace("[display]\nport = 0", "[display]\nenabled = false")
    if fallback:
        text = text.replace('directory = "unused"', f'directory = "unused"\nfallback = "{fallback}"')
    feeder.config.write_text(text)


def storage(running: Daemon) -> dict[str, Any]:
    content: dict[str, Any] = running.health().get("storage", {})
    return content


def wait_for(running: Daemon, *states: str) -> dict[str, Any]:
    """Until the storage is in one of these states; returns what health says of it."""
    state: dict[str, Any] = {}

    def there() -> bool:
        state.update(storage(running))
        return state.get("state") in states

    try:
        until(there, what=f"storage {states}")
    except AssertionError as error:
        raise AssertionError(f"{error}; it says {state}") from None
    return state


def feed_on(feeder: Feeder, count: int = 50) -> None:
    fed = len(feeder.sent_lines)
    until(lambda: len(feeder.sent_lines) > fed + count, what="more frames")


def begin(feeder: Feeder, running: Daemon) -> None:
    until(lambda: running.health().get("links", {}).get("line", {}).get("state") == "silent", what="an open line")
    feeder.start()
    feed_on(feeder)


def assert_complete(feeder: Feeder, *folders: Path) -> None:
    """Every byte that was sent is there, in order, and fti verify says so.

    Of outputs, which can be made again, those may be missing that a failed medium has not kept.
    """
    expected = b"".join(feeder.sent_lines)
    frames = list(Recording.open(*folders).frames())
    for link in ("line", "eth"):
        assert b"".join(frame.data for frame in frames if frame.link == link) == expected
    assert [frame.seq for frame in frames] == list(range(frames[-1].seq + 1))
    verified = fti("verify", *map(str, folders), "--json")
    findings = json.loads(verified.stdout)["findings"]
    assert [text for text in findings if "_derived_" not in text] == []
    assert verified.returncode == (3 if findings else 0), verified.stdout + verified.stderr


def events(*folders: Path) -> str:
    output = Recording.open(*folders).messages("/fti/event", kind="raw")
    return "\n".join(json.loads(data)["message"] for *_, data in output)


def test_a_recorder_that_is_started_again_while_the_medium_is_full(tmp_path: Path, feeder: Feeder) -> None:
    configure(feeder)
    medium = Tmpfs(tmp_path / "medium", 8)
    with mounted(medium):
        arguments = (feeder.config, tmp_path / "run", "--out", str(medium.folder), "--links", str(feeder.links))
        filler = medium.fill()
        refused = fti("run", str(feeder.config), "--out", str(medium.folder), "--run-dir", str(tmp_path / "refused"))
        assert refused.returncode == 2
        assert "No space left" in refused.stdout + refused.stderr
        filler.unlink()
        with daemon(*arguments) as running:
            session = running.session
            begin(feeder, running)
            filler = medium.fill()
            wait_for(running, "error")
            killed = running.pid_of("recorder")
            os.kill(killed, signal.SIGKILL)
            until(lambda: running.pid_of("recorder") != killed, what="another recorder")
            hint = until(lambda: s["hint"] if (s := storage(running)).get("file") is None else "", what="no file")
            assert "No space left" in hint
            feed_on(feeder, 10)
            marked = len(feeder.sent_lines)
            feed_on(feeder)
            filler.unlink()
            wait_for(running, "ok")
            feed_on(feeder)
            feeder.stop()
            running.stop()
        held = b"".join(feeder.sent_lines[marked:])
        for link in ("line", "eth"):
            assert b"".join(f.data for f in Recording.open(session).frames() if f.link == link).endswith(held)
        assert fti("verify", str(session)).returncode == 3  # what the killed recorder held


def test_a_medium_that_is_full_frozen_taken_away_and_moved_without_another(tmp_path: Path, feeder: Feeder) -> None:
    configure(feeder)
    medium = Ext4(tmp_path / "medium")
    with mounted(medium):
        arguments = (feeder.config, tmp_path / "run", "--out", str(medium.folder), "--links", str(feeder.links))
        with daemon(*arguments) as running:
            session = running.session
            begin(feeder, running)
            filler = medium.fill()
            assert "No space left" in wait_for(running, "error")["hint"]
            feed_on(feeder)
            assert storage(running)["file_age_s"] > 0.3
            filler.unlink()
            wait_for(running, "ok")
            medium.freeze()
            assert "accepted no bytes for" in wait_for(running, "slow", "error")["hint"]
            wait_for(running, "error")
            medium.thaw()
            wait_for(running, "ok")
            medium.unmount()
            wait_for(running, "gone")
            feed_on(feeder)
            medium.mount()
            wait_for(running, "ok")
            away = session.with_name("away")
            session.rename(away)
            until(lambda: storage(running).get("file") and Path(storage(running)["file"]).exists(), what="a new file")
            feed_on(feeder)
            feeder.stop()
            running.stop()
        for file in away.iterdir():
            file.rename(session / file.name)
        assert_complete(feeder, session)
        output = events(session)
        assert "the medium refuses" in output
        assert "lost: nothing" in output


@pytest.mark.parametrize("ends", [None, signal.SIGINT])
def test_a_medium_that_refuses_to_the_end_is_no_success(
    tmp_path: Path, feeder: Feeder, ends: signal.Signals | None
) -> None:
    configure(feeder)
    medium = Tmpfs(tmp_path / "medium", 8)
    with mounted(medium):
        arguments = (feeder.config, tmp_path / "run", "--out", str(medium.folder), "--links", str(feeder.links))
        with daemon(*arguments, *([] if ends else ["--duration", "8"])) as running:
            session = running.session
            begin(feeder, running)
            medium.fill()
            wait_for(running, "error")
            feed_on(feeder)
            if ends:
                assert running.stop(ends) == 3
            else:
                assert running.wait() == 3
        feeder.stop()
        output = "\n".join(running.lines)
        assert not any(line.startswith("recorded ") for line in running.lines)
        match = re.search(r"not everything was recorded: (\d+) of (\d+) frames .* are lost: .*No space left", output)
        assert match and 0 < int(match[1]) < int(match[2]), output
        ledger = re.search(r"the last ledger is in (\S+)", output)
        assert ledger, output
        ledger_table = json.loads(Path(ledger[1]).read_text())
        assert ledger_table["final"] and ledger_table["links"]["eth"]["held_frames"] + ledger_table["links"]["line"][
            "held_frames"
        ] == int(match[1])
        assert fti("verify", str(session)).returncode == 3


def test_it_goes_on_at_the_fallback_and_comes_back(tmp_path: Path, feeder: Feeder) -> None:
    medium, other = Ext4(tmp_path / "medium"), Tmpfs(tmp_path / "other", 24)
    configure(feeder, other.folder)
    with mounted(medium, other):
        arguments = (feeder.config, tmp_path / "run", "--out", str(medium.folder), "--links", str(feeder.links))
        with daemon(*arguments) as running:
            session = running.session
            fallback = other.folder / session.name
            begin(feeder, running)
            medium.freeze()
            assert str(fallback) in wait_for(running, "fallback")["hint"]
            feed_on(feeder)
            medium.thaw()
            assert Path(wait_for(running, "ok")["file"]).parent == session
            feed_on(feeder)
            medium.break_down()
            assert "Read-only file system" in wait_for(running, "fallback")["hint"]
            feed_on(feeder)
            medium.unmount()
            until(medium.repair, what="a medium that nobody holds")
            medium.mount()
            assert Path(wait_for(running, "ok")["file"]).parent == session
            feed_on(feeder)
            feeder.stop()
            running.stop()
        assert_complete(feeder, session, fallback)
        alone = fti("verify", str(session))
        assert alone.returncode == 3, alone.stdout
        assert str(fallback) in alone.stdout
        fti("verify", str(fallback))

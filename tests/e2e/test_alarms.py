"""Alarms of a real daemon: they outlast navigation and display, until they have ended and were acknowledged."""

from __future__ import annotations

import json
import os
import pwd
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.flights import demo_config, emulator
from tests.e2e.harness import START_S, Daemon, daemon, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]
LINK, STOPPED = "link:radalt_line", "navigation"


def _alarms(running: Daemon) -> dict[str, dict[str, Any]]:
    return {row["id"]: row for row in running.watch()["alarms"]}


def _wait_for(running: Daemon, identity: str, *, lasts: bool) -> None:
    def found() -> bool:
        row = _alarms(running).get(identity)
        return row is not None and (row["end_ns"] is None) is lasts

    until(found, START_S, f"{identity} that {'lasts' if lasts else 'has ended'}")


def _wait_for_restart(running: Daemon, process: str) -> None:
    until(lambda: running.health()["processes"][process]["restarts"] == 1, START_S, f"a restart of {process}")


def test_an_alarm_outlasts_navigation_and_display_and_is_recorded(tmp_path: Path) -> None:
    config, links = demo_config(tmp_path), tmp_path / "links"
    with emulator("gnss_degraded", config, links, "--wait") as flying:
        until(lambda: links.is_dir() or flying.poll() is not None, START_S, "the ports")
        with daemon(config, tmp_path / "out", "--links", str(links)) as running:
            session = running.session
            until(lambda: running.health()["links"]["radalt_line"]["state"] == "good", START_S, "a good link")
            flying.send_signal(signal.SIGSTOP)
            _wait_for(running, LINK, lasts=True)
            for process in ("navigation", "display"):
                os.kill(running.pid_of(process), signal.SIGKILL)
                _wait_for_restart(running, process)
                assert _alarms(running)[LINK]["end_ns"] is None
            _wait_for(running, STOPPED, lasts=False)
            flying.send_signal(signal.SIGCONT)
            _wait_for(running, LINK, lasts=False)
            done = fti("acknowledge", "--run-dir", str(running.run_dir))
            assert done.returncode == 0, done.stderr
            assert {LINK, STOPPED}.isdisjoint(_alarms(running))
            running.stop()
    recorded = {row["id"]: row for row in json.loads(fti("info", "--json", str(session)).stdout)["alarms"]}
    for identity in (LINK, STOPPED):
        assert recorded[identity]["end_ns"] > recorded[identity]["begin_ns"]
        assert pwd.getpwuid(os.getuid()).pw_name in recorded[identity]["acknowledged_by"]

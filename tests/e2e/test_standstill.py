"""A recorder that does not move any more is replaced by its stand-in, and everything is accounted for."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest

from fti.logger.reading.recording import Recording
from tests.e2e.feeder import Feeder
from tests.e2e.harness import daemon, fti
from tests.helpers import until
from tests.processes import children_of, command_of

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]


def _recorders(pid: int) -> set[int]:
    """The recorder and its stand-in."""
    return {child for child in children_of(pid) if "fti.service.recorder" in command_of(child)}


def test_a_stopped_recorder_is_replaced_and_the_recording_goes_on(tmp_path: Path) -> None:
    with Feeder(tmp_path / "links") as feeder:
        with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
            session = running.session
            until(lambda: running.health()["links"].get("line", {}).get("state") == "silent", what="an open line")
            feeder.start()
            until(lambda: len(_recorders(running.process.pid)) == 2, what="the stand-in")
            until(lambda: len(feeder.sent_lines) > 200, what="more than a ledger")
            stopped = running.pid_of("recorder")
            os.kill(stopped, signal.SIGSTOP)
            until(lambda: running.health()["processes"]["recorder"]["restarts"] == 1, what="another recorder")
            assert running.pid_of("recorder") != stopped
            fed = len(feeder.sent_lines)
            until(lambda: len(feeder.sent_lines) > fed + 100, what="more frames")
            feeder.stop()
            assert running.stop() == 130
        last = feeder.sent_lines[-1]
    recording = Recording.open(session)
    for link in ("line", "eth"):
        assert b"".join(frame.data for frame in recording.frames() if frame.link == link).endswith(last)
    events = [json.loads(data)["message"] for *_, data in recording.messages("/fti/event", kind="raw")]
    order = [next(i for i, text in enumerate(events) if words in text) for words in ("no progress for", "signal 9")]
    assert order == sorted(order), events
    proof = fti("verify", str(session), "--json")
    checks = {check["name"]: check for check in json.loads(proof.stdout)["checks"]}
    assert proof.returncode == 3, proof.stdout
    assert {name for name, check in checks.items() if check["verdict"] == "refuted"} == set()
    assert checks["ledger"]["verdict"] == checks["stamps"]["verdict"] == "ok"
    assert f"recorder {stopped} ended without a final ledger" in checks["recorders"]["lines"][0]["text"]
    assert "no recorder ran for" in checks["recorders"]["lines"][0]["text"]

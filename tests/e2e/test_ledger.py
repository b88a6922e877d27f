"""The account of a link closes: against what was sent to it, over losses that really happen, and over a kill."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.logger.reading.recording import Recording
from tests.e2e.feeder import Feeder
from tests.e2e.harness import Daemon, daemon, free_udp_port
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]
CONFIG = """
[session]
name = "burst"
directory = "unused"
min_free_mb = 10

[[link]]
name = "eth"
kind = "udp"
bind = "127.0.0.1:{port}"

[display]
port = 0
"""
#: More than any socket queue holds: 8 MiB, and the kernel counts at least 256 B for each.
BURST = 40_000


@contextmanager
def _stopped(pid: int) -> Iterator[None]:
    """The process gets no time meanwhile."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def _ledger(running: Daemon) -> dict[str, Any]:
    """The live account of the link."""
    content: dict[str, Any] = running.health()["links"]["eth"]["ledger"]
    return content


def _verify(session: Path) -> tuple[int, dict[str, Any]]:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        code = main(["verify", str(session), "--json"])
    return code, json.loads(printed.getvalue())


def test_what_a_full_socket_queue_drops_is_counted_and_the_sum_is_what_was_sent(tmp_path: Path) -> None:
    port = free_udp_port()
    config = tmp_path / "burst.toml"
    config.write_text(CONFIG.format(port=port))
    sent_count = 0
    with daemon(config, tmp_path / "out") as running, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        session = running.session
        until(lambda: running.health().get("links", {}).get("eth", {}).get("state") == "silent", what="an open link")
        recorder = running.pid_of("recorder")
        with _stopped(running.process.pid), _stopped(recorder):  # both: one that does not move alone is replaced
            for sent_count in range(1, BURST + 1):
                sender.sendto(b"%08d" % sent_count, ("127.0.0.1", port))
        live = until(
            lambda: (a := _ledger(running))["in_frames"] == sent_count and not a["held_frames"] and a, what="the sum"
        )
        assert running.stop() == 130
    dropped = live["dropped"]["socket_queue"]["frames"]
    dropped_counts = [
        int(line.split()[5]) for line in running.lines if line.startswith("warning: eth: the kernel dropped ")
    ]
    assert sum(dropped_counts) == dropped, running.lines
    assert not [line for line in running.lines if "storage" in line]
    assert dropped > 0
    assert live["recorded_frames"] + dropped == sent_count
    numbers = [int(frame.data) for frame in Recording.open(session).frames() if frame.link == "eth"]
    assert len(numbers) == sent_count - dropped
    assert numbers == sorted(set(numbers))
    code, proof = _verify(session)
    assert (code, proof["verdict"], proof["missing"]) == (3, "loss", 0)
    account = proof["accounts"]["/raw/eth"]
    assert account["in"]["frames"] == sent_count
    assert account["dropped"] == {"socket_queue": {"frames": dropped, "bytes": 0}}
    assert proof["findings"] == [f"/raw/eth: {dropped} frames were dropped: socket_queue"]


def test_the_ledgers_of_a_killed_recorder_and_of_the_next_one_close(tmp_path: Path) -> None:
    with (
        Feeder(tmp_path / "links") as feeder,
        daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running,
    ):
        session = running.session
        feeder.start()
        until(lambda: len(feeder.sent_lines) > 200, what="more than a ledger")
        os.kill(running.pid_of("recorder"), signal.SIGKILL)
        until(lambda: running.health()["processes"]["recorder"]["restarts"] == 1, what="a restart")
        fed = len(feeder.sent_lines)
        until(lambda: len(feeder.sent_lines) > fed + 50, what="more frames")
        feeder.stop()
        assert running.stop() == 130
    code, proof = _verify(session)
    checks = {check["name"]: check for check in proof["checks"]}
    assert code == 3, proof["findings"]
    assert checks["ledger"]["verdict"] == checks["splits"]["verdict"] == "ok"
    assert checks["files"]["verdict"] == "note"  # the one of the killed recorder was closed later
    assert "ended without a final ledger" in checks["recorders"]["lines"][0]["text"]
    seqs = [seq for seq, _ in Recording.open(session).numbered_messages()]
    assert proof["numbered"] == len(seqs)
    assert proof["missing"] == seqs[-1] + 1 - len(seqs)
    recorded = sum(len(frame.data) for frame in Recording.open(session).frames() if frame.link == "line")
    assert proof["accounts"]["/raw/line"]["recorded"]["bytes"] == recorded

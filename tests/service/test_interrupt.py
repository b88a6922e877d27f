"""Ctrl-C while the daemon is still loading its libraries."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fti.interrupts import InterruptHandler
from fti.service.daemon import _stop_on_signals
from tests.e2e.feeder import CONFIG
from tests.e2e.harness import free_udp_port

#: ``fti run``; an interrupt comes when the module MODULE is about to be imported, and is lost there.
INTERRUPTED = """
import contextlib, signal, sys

class Interrupt:
    def find_spec(self, name, path, target=None):
        if name == MODULE:
            sys.meta_path.remove(self)
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)

MODULE, *arguments = sys.argv[1:]
sys.meta_path.insert(0, Interrupt())
from fti.cli.main import main
sys.exit(main(arguments))
"""


async def test_an_interrupt_that_a_library_has_swallowed_ends_the_daemon() -> None:
    before = signal.signal(signal.SIGINT, InterruptHandler())
    stops = []
    try:
        with contextlib.suppress(KeyboardInterrupt):  # as a library does
            signal.raise_signal(signal.SIGINT)
        signalled = _stop_on_signals(lambda: stops.append(True))
        await asyncio.sleep(0)
        assert signalled.is_set()
        assert stops == [True]
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().remove_signal_handler(number)
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("module", ["fti.cli.run", "fti.config.tables", "fti.service.supervisor.process"])
@pytest.mark.parametrize("command", ["run", "demo"])
def test_an_interrupt_that_an_import_has_swallowed_ends_the_command(command: str, module: str, tmp_path: Path) -> None:
    config, left = tmp_path / "small.toml", tmp_path / "run"
    config.write_text(CONFIG.format(port=free_udp_port()))
    arguments = ["run", str(config), "--links", str(tmp_path)] if command == "run" else ["demo", "--headless"]
    process = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, *arguments, "--out", str(tmp_path / "out"), "--run-dir", str(left)],
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert process.returncode == 130, process.stderr
    assert not list(left.glob("*"))

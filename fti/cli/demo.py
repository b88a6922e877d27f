"""Fly an emulated approach, record it, and show it in the browser.

Runs emulator, daemon and display together: emulated sensors on ptys, UDP and CAN of this machine repeat three-degree
approaches over real terrain until Ctrl-C.

  fti demo
  fti demo --scenario obstacle
  fti demo --headless --duration 60 --out /tmp/demo

The recording is kept; the last line names its folder.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from typing import TYPE_CHECKING

from fti.cli._arguments import seconds
from fti.cli._daemon import early_recorder, serve
from fti.cli._printing import print_line

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Callable
    from pathlib import Path

    from fti.config import Config
    from fti.service.supervisor.process import Supervisor

EMULATOR_END_TIMEOUT_S, NOTICE_PERIOD_S = 10.0, 10.0
#: Configuration file of the demonstration, in the folder of the emulator's ports.
CONFIG = "demo.toml"
#: Keys in it that name a file or an address.
NAMED_FILE = re.compile(r'((?:profile|\w+_file) = )"([^"]+)"')
BOUND_PORT = re.compile(r'(bind = "127\.0\.0\.1:)(\d+)"')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti demo``."""
    parser.add_argument("--duration", type=seconds, metavar="S", help="end S seconds after the sensors have started")
    parser.add_argument("--headless", action="store_true", help="do not open the browser")
    parser.add_argument("--out", metavar="DIR", default="data", help="record below DIR (default: data)")
    parser.add_argument("--scenario", default="nominal", metavar="SCENARIO", help="scenario to fly (fti hil --list)")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory for fti watch, mark, send and page")


def run(args: argparse.Namespace) -> int:
    """Run emulator and daemon to their end."""
    import tempfile
    from pathlib import Path

    with early_recorder() as recorder, tempfile.TemporaryDirectory(prefix="fti-demo-") as links:
        import asyncio

        from fti.cli.page import open_browser
        from fti.hil import scenario as scenarios

        scenario = scenarios.find(args.scenario)
        file, text = _copy_on_free_ports(Path(scenarios.load(scenario).config), Path(links))
        config = _configure(file, text, links, args.out)

        async def fly(supervisor: Supervisor) -> None:
            if not args.headless and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
                await supervisor.display_ready.wait()
                await asyncio.to_thread(open_browser, supervisor.run_dir)  # the address is printed in any case
            on_begin = _end_timer(args.duration)
            supervisor.suppress_sensor_alarms()
            await _wait_for_navigation(supervisor)
            while True:
                await _run_flight(scenario, file, links, supervisor, on_begin)
                await supervisor.readmit_all("the demonstration, after a flight")  # the next one begins far away

        return serve(config, recorder, run_dir=args.run_dir, companion=fly)


def _copy_on_free_ports(file: Path, folder: Path) -> tuple[Path, str]:
    """A copy of the scenario's configuration in ``folder`` that binds free ports; file and text.

    Two demonstrations must not receive each other's sensors.  A configured port that is free stays: then the recording
    can be replayed to a daemon with the configuration.
    """
    import socket

    from fti import config as configuration

    _, text = configuration.read_toml(file)

    def on_free_port(found: re.Match[str]) -> str:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            try:
                sock.bind(("127.0.0.1", int(found[2])))
            except OSError:
                sock.bind(("127.0.0.1", 0))
            return f'{found[1]}{sock.getsockname()[1]}"'

    moved = BOUND_PORT.sub(on_free_port, text)
    moved = NAMED_FILE.sub(lambda found: f'{found[1]}"{(file.parent / found[2]).absolute()}"', moved)
    (folder / CONFIG).write_text(moved)
    return folder / CONFIG, moved


def _configure(file: Path, text: str, links: str, out: str) -> Config:
    """The same with the emulator's ports, recording below ``out``."""
    import tomllib

    from fti import config as configuration

    config = configuration.parse(tomllib.loads(text), text, file)
    moved = configuration.with_session(configuration.with_links(config, links), directory=out, origin="hil")
    return moved.model_copy(update={"display": moved.display.model_copy(update={"port": 0})})


async def _wait_for_navigation(supervisor: Supervisor) -> None:
    """Wait until navigation runs; on a new machine it compiles first."""
    import asyncio

    begin = time.monotonic()
    while not supervisor.navigation_ready.is_set():
        try:
            await asyncio.wait_for(supervisor.navigation_ready.wait(), NOTICE_PERIOD_S)
        except TimeoutError:
            elapsed_s = time.monotonic() - begin
            text = f"navigation is compiled, at the first start only (about a minute): {elapsed_s:.0f} s"
            print_line(text, error=True, flush=True)


def _end_timer(duration_s: float | None) -> Callable[[], None]:
    """Return the function to call when the sensors of a flight have started; the first call starts the timer.

    When the timer expires, this task is cancelled.  The timer does not start with the recording: on a new machine the
    emulator compiles first, longer than a short session.
    """
    import asyncio

    ends: list[asyncio.TimerHandle] = []
    flying = asyncio.current_task()
    assert flying

    def on_begin() -> None:
        if duration_s is not None and not ends:
            ends.append(asyncio.get_running_loop().call_later(duration_s, flying.cancel))

    return on_begin


async def _end(emulator: asyncio.subprocess.Process, *, is_ready: bool) -> None:
    """Terminate the emulator; kill it after a timeout, or if its ports do not exist yet."""
    import asyncio

    if not is_ready:  # it has sent nothing yet, and may be compiling
        emulator.kill()
    emulator.terminate()
    try:
        await asyncio.wait_for(emulator.wait(), EMULATOR_END_TIMEOUT_S)
    except TimeoutError:
        emulator.kill()
        await emulator.wait()


async def _run_flight(
    scenario: Path, config: Path, links: str, supervisor: Supervisor, on_begin: Callable[[], None]
) -> None:
    """Fly once, with the emulator in its own process, so that it cannot disturb the daemon.

    on_begin : called when the sensors have started.  Raises FtiError when the emulator fails.
    """
    import asyncio

    from fti.cli.hil import FLIGHT_END
    from fti.errors import FtiError

    supervisor.suppress_sensor_alarms()
    truth = supervisor.folder.next_path("truth")
    emulator = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "fti.cli.main", "hil", str(scenario)),
        *("--links", links, "--config", str(config), "--truth", str(truth), "--wait"),
        *("--report", str(truth.with_suffix(".json")), "--run-dir", str(supervisor.run_dir)),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        process_group=0,
    )
    assert emulator.stdout
    is_ready = False
    try:
        if await emulator.stdout.readline():
            is_ready = True
            print_line("flying; Ctrl-C ends", flush=True)
            supervisor.resume_sensor_alarms()
            on_begin()
        async for line in emulator.stdout:  # the report follows, which is also in a file
            if line.strip() == FLIGHT_END.encode():
                supervisor.suppress_sensor_alarms()
        code = await emulator.wait()
    except asyncio.CancelledError:
        supervisor.expect_end()
        await _end(emulator, is_ready=is_ready)
        raise
    if code:
        raise FtiError(f"the emulator ended with exit code {code}")

"""The recorder of a bench: ``fti run`` as a separate program, on the output links of the unit under test."""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import signal
import threading
import tty
from pathlib import Path

from fti import config as configuration
from fti.devices import bind_devices
from fti.run_directory import INFO
from fti.testing.errors import BenchError
from fti.testing.ports import LinkAddress, addresses, on_free_ports, write_config
from fti.testing.process import FTI, BenchProcess, quiet_environment
from fti.testing.workspace import Workspace

TIMEOUT_START_S = 60.0
TIMEOUT_END_S = 30.0
#: Exit code of a complete recording after SIGINT.
INTERRUPTED = 130


READ_BYTES = 4096


class PtyPair:
    """A serial cable of two ptys between two device files, until ``close``.

    ends : symlinks to the device files.  Unread data are lost when the buffer of an end is full, as on a serial line
    without flow control.
    """

    def __init__(self, ends: tuple[Path, Path]) -> None:
        self._descriptors: list[int] = []
        self._masters = [self._open(end) for end in ends]
        self._stop = os.eventfd(0)
        self._thread = threading.Thread(target=self._carry, name="fti-testing-cable", daemon=True)
        self._thread.start()

    def _open(self, end: Path) -> int:
        """Open one end; returns the master.  The slave stays open: otherwise the master reports an end of file."""
        master, slave = os.openpty()
        self._descriptors += master, slave
        tty.setraw(slave)
        os.set_blocking(master, False)
        end.parent.mkdir(parents=True, exist_ok=True)
        end.symlink_to(os.ttyname(slave))
        return master

    def _carry(self) -> None:
        other = dict(zip(self._masters, reversed(self._masters), strict=True))
        while True:
            readable, _, _ = select.select([*self._masters, self._stop], [], [])
            if self._stop in readable:
                return
            for master in readable:
                with contextlib.suppress(BlockingIOError):
                    os.write(other[master], os.read(master, READ_BYTES))

    def close(self) -> None:
        """Stop the transfer and close both ptys."""
        os.eventfd_write(self._stop, 1)
        self._thread.join()
        for descriptor in (*self._descriptors, self._stop):
            os.close(descriptor)


class Recorder:
    """Records every byte that the unit under test sends.

    links : address of each link, by name; session : the session folder, None before ``start``
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self.process: BenchProcess | None = None
        self.links: dict[str, LinkAddress] = {}
        self.session: Path | None = None
        self.truth_in_session: Path | None = None
        self._has_ended = False
        self._cables: list[PtyPair] = []

    @property
    def run_dir(self) -> Path:
        """Its run directory, as for ``fti watch``."""
        return self._workspace.run_folder / "run"

    def start(self, config: str | Path, *, real_ports: bool = False) -> None:
        """Record the links of a configuration.

        config : output links of the unit, and devices, which define the drivers for its bytes; UDP links get free
        ports of loopback, and the unit's end of a serial line or an slcan adapter is a pty
        real_ports : open serial lines and slcan adapters at the configured ports
        Raises MissingError or ConfigError with one sentence, BenchError when the recorder does not start.
        """
        if self.process:
            raise BenchError("the recorder of this bench was already started")
        workspace = self._workspace
        loaded = configuration.load(config)
        bind_devices(loaded)
        moved = on_free_ports(configuration.with_session(loaded, origin="hil"))
        workspace.take_slot()
        unit_ends, own_ends = workspace.folder / "unit_links", workspace.folder / "recorder_links"
        self.links = addresses(moved, None if real_ports else unit_ends)
        file, out = workspace.folder / "recorder.toml", workspace.folder / "session"
        write_config(moved, file)
        command = [*FTI, "run", str(file), "--out", str(out), "--run-dir", str(self.run_dir)]
        if not real_ports:
            lines = [name for name, link in self.links.items() if link.path]
            self._cables = [PtyPair((unit_ends / name, own_ends / name)) for name in lines]
            command += ["--links", str(own_ends)] * bool(lines)
        self.process = BenchProcess("recorder", "recorder", command, workspace.folder, environment=quiet_environment())
        workspace.needed.append(self.process)
        info_file = self.run_dir / INFO
        workspace.wait_for(info_file.is_file, TIMEOUT_START_S, lambda: "the recorder")
        self.session = Path(json.loads(info_file.read_text())["session"])

    def end(self) -> None:
        """End the recording and move the truth of the flight into it.

        Raises BenchError when the recording is incomplete.
        """
        process, truth = self.process, self._workspace.truth
        if process is None or self._has_ended:
            return
        self._has_ended = True
        code = process.end(signal.SIGINT, TIMEOUT_END_S)
        for cable in self._cables:
            cable.close()
        if self.session and truth.is_file():
            self.truth_in_session = self.session / f"{self.session.name}_{truth.name.removeprefix('flight_')}"
            shutil.move(truth, self.truth_in_session)
        if code not in (0, INTERRUPTED):
            raise BenchError(f"the recorder ended with exit code {code}\n{process.last_lines()}")

"""The unit under test: one program or several, in any language, on the ports of the bench."""

from __future__ import annotations

import os
import signal
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace

from fti.testing.errors import BenchError, UnitKilledWarning
from fti.testing.ports import is_tcp_port_open, is_udp_port_bound
from fti.testing.process import BenchProcess
from fti.testing.workspace import Workspace

TIMEOUT_READY_S = 30.0
TIMEOUT_END_S = 5.0


class UnitUnderTest:
    """The programs of the unit under test.

    Arguments and environment may have placeholders for each link of emulator and recorder:
    ``{emulator.LINK.path}`` (device file of a serial line or an slcan adapter), ``{emulator.LINK.port}`` (UDP port that
    the unit binds), ``{recorder.LINK.port}`` (to which it sends), ``.host``, ``.peer_port``.  Write a brace twice.
    """

    def __init__(self, workspace: Workspace, placeholders: Callable[[], Mapping[str, SimpleNamespace]]) -> None:
        self._workspace, self._placeholders = workspace, placeholders
        self.programs: list[BenchProcess] = []
        self._end_methods: list[tuple[BenchProcess, int, float]] = []

    def start(
        self,
        command: Sequence[str | Path],
        *,
        env: Mapping[str, str] | None = None,
        cwd: str | Path | None = None,
        ready_text: str | None = None,
        ready_udp_port: str | int | None = None,
        ready_tcp_port: str | int | None = None,
        ready_within_s: float = TIMEOUT_READY_S,
        end_signal: int = signal.SIGTERM,
        end_within_s: float = TIMEOUT_END_S,
    ) -> BenchProcess:
        """Start a program and wait until it is ready; several calls start several programs.

        env : in addition to the variables of this process
        ready_text : the program is ready when it has written this on stdout or stderr
        ready_udp_port, ready_tcp_port : ... when it has bound this port of loopback; a number or a placeholder
        end_signal, end_within_s : signal that ends it, and timeout after which it is killed with a
        ``UnitKilledWarning``
        Raises BenchError with its last lines when it ends or is not ready in time.
        """
        arguments = [self._fill_placeholders(str(part)) for part in command]
        variables = {name: self._fill_placeholders(text) for name, text in (env or {}).items()}
        number = len(self.programs)
        title = f"unit under test, {Path(arguments[0]).name}" + (f" ({number})" if number else "")
        program = BenchProcess(
            title,
            f"unit_{number}",
            arguments,
            self._workspace.folder,
            environment={**os.environ, **variables},
            cwd=None if cwd is None else Path(cwd),
        )
        self.programs.append(program)
        self._workspace.needed.append(program)
        self._end_methods.append((program, end_signal, end_within_s))
        udp, tcp = (self._port(port) for port in (ready_udp_port, ready_tcp_port))

        def is_ready() -> bool:
            return (
                (ready_text is None or ready_text in program.output)
                and (udp is None or is_udp_port_bound(udp))
                and (tcp is None or is_tcp_port_open(tcp))
            )

        conditions = {"text": ready_text, "UDP port": udp, "TCP port": tcp}
        text = ", ".join(f"{kind} {value!r}" for kind, value in conditions.items() if value is not None)
        self._workspace.wait_for(is_ready, ready_within_s, lambda: f"{text} of {title}\n{program.last_lines()}")
        return program

    def _port(self, port: str | int | None) -> int | None:
        return None if port is None else int(self._fill_placeholders(str(port)))

    def _fill_placeholders(self, text: str) -> str:
        """A text with its placeholders filled in.  Raises BenchError, which names the existing links."""
        try:
            return text.format(**self._placeholders())
        except (AttributeError, KeyError, IndexError, ValueError) as error:
            links = [f"{part}.{name}" for part, found in self._placeholders().items() for name in vars(found)]
            raise BenchError(
                f"{text!r}: invalid placeholder ({error}); links: {', '.join(links) or 'none yet'}, each with .path, "
                ".host, .port and .peer_port; write a brace twice"
            ) from None

    def end(self) -> None:
        """End every program: by its signal, or by SIGKILL after the timeout."""
        for program, number, timeout_s in self._end_methods:
            program.end(number, timeout_s)
            if program.was_killed:
                text = f"{program.title} did not end within {timeout_s:g} s of {signal.Signals(number).name}; killed"
                warnings.warn(text, UnitKilledWarning, stacklevel=2)
        self._end_methods.clear()

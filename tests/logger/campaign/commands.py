"""The ways that a user has, called in this process: exit code, what was printed, an exception that got out."""

from __future__ import annotations

import contextlib
import io
import json
import os
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from fti.cli.main import TRACEBACK, main


@dataclass(frozen=True, slots=True)
class Result:
    """Of a command.  crash : the traceback; None when it came to its end."""

    command: str
    code: int
    out: str
    err: str
    crash: str | None = None

    @property
    def text(self) -> str:
        """All that was printed."""
        return self.out + self.err

    def json(self) -> dict[str, Any]:
        """The printed JSON; empty when there is none."""
        try:
            content: dict[str, Any] = json.loads(self.out)
        except ValueError:
            return {}
        return content


def fti(*arguments: str | Path) -> Result:
    """Run ``fti`` with these arguments."""
    out, err = io.StringIO(), io.StringIO()
    crash = None
    code = -1
    shown = mock.patch.dict(os.environ, {TRACEBACK: "1"})  # else the last net turns it into a sentence
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), shown:
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else -1
        except Exception:  # noqa: BLE001  (what gets out is what is looked for)
            crash = traceback.format_exc()
    return Result(" ".join(map(str, arguments[:1])), code, out.getvalue(), err.getvalue(), crash)

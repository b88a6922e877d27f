"""The frame of every command: how it ends."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic_core import SchemaError

from fti.cli import ports
from fti.cli.main import EXIT_INTERRUPTED, main


def test_an_interrupt_while_tables_are_built_is_an_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C within pydantic comes out as pydantic's own error."""

    def run(args: argparse.Namespace) -> int:
        raise SchemaError('Error building "literal" validator:\n  KeyboardInterrupt: ')

    monkeypatch.setattr(ports, "run", run)
    assert main(["ports"]) == EXIT_INTERRUPTED


def test_a_table_that_cannot_be_built_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(args: argparse.Namespace) -> int:
        raise SchemaError("unknown type")

    monkeypatch.setattr(ports, "run", run)
    with pytest.raises(SchemaError, match="unknown type"):
        main(["ports"])


def _failing(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def run(args: argparse.Namespace) -> int:
        raise error

    monkeypatch.setattr(ports, "run", run)


@pytest.mark.parametrize("error", [KeyError("t_ns"), RecursionError("too deep\nagain"), MemoryError(), TypeError("x")])
def test_what_nobody_expected_is_one_sentence(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("FTI_TRACEBACK")
    _failing(monkeypatch, error)
    assert main(["ports"]) == 3
    message = capsys.readouterr().err
    assert message.startswith("fti: ports: ") and message.count("\n") == 1
    assert type(error).__name__ in message and "FTI_TRACEBACK=1" in message


def test_with_the_variable_it_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FTI_TRACEBACK", "1")
    _failing(monkeypatch, KeyError("t_ns"))
    with pytest.raises(KeyError):
        main(["ports"])


def test_half_of_a_surrogate_pair_is_printed_escaped(tmp_path: Path) -> None:
    """In a process of its own: there standard output is strict."""
    name = os.fsdecode(b"\xff\xfe.mcap")
    (tmp_path / name).write_bytes(b"\x89MCAP0\r\n")
    done = subprocess.run(
        [sys.executable, "-m", "fti.cli.main", "info", name],
        capture_output=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONUTF8": "1", "PYTHONIOENCODING": "utf-8:strict"},
        check=False,
    )
    assert done.returncode == 3, done.stderr
    assert b"\\udcff\\udcfe.mcap" in done.stdout and b"Traceback" not in done.stderr

"""The frame of every command: how it ends."""

from __future__ import annotations

import argparse

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

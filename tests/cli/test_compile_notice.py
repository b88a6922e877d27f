"""The notice of a compilation: once, and only where something is compiled."""

from __future__ import annotations

import numba
import pytest

from fti.cli._compile_notice import NOTICE, announce_compilation


def test_compilation_is_announced_once(capsys: pytest.CaptureFixture[str]) -> None:
    one, two = numba.njit(lambda x: x + 1), numba.njit(lambda x: x - 1)
    with announce_compilation():
        one(1)
        two(1)
    assert capsys.readouterr().err.splitlines() == [NOTICE]
    with announce_compilation():
        one(1)
    two(1.5)
    assert capsys.readouterr().err == ""

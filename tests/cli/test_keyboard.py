"""Keys of a terminal: they act while the command runs, and the terminal is as before afterwards."""

from __future__ import annotations

import os
import termios
from collections.abc import Iterator

import pytest

from fti.cli import _keyboard
from fti.cli._keyboard import handle_keys, in_foreground
from tests.helpers import until_async


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    """The person's end and the command's end."""
    person, command = os.openpty()
    yield person, command
    os.close(person)
    os.close(command)


async def test_keys_act_at_once_and_others_do_nothing(
    terminal: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    person, command = terminal
    monkeypatch.setattr(_keyboard, "in_foreground", lambda descriptor: True)
    before, pressed = termios.tcgetattr(command), list[str]()
    with handle_keys({" ": lambda: pressed.append("pause"), ".": lambda: pressed.append("step")}, command) as there_are:
        assert there_are
        os.write(person, b"x. .\n")
        await until_async(lambda: len(pressed) >= 3)
        assert pressed == ["step", "pause", "step"]
    assert termios.tcgetattr(command) == before


async def test_in_the_background_the_terminal_is_left_alone(terminal: tuple[int, int]) -> None:
    """It is no terminal of this process: reading would stop the job."""
    _, command = terminal
    before = termios.tcgetattr(command)
    with handle_keys({}, command) as there_are:
        assert not there_are
        assert termios.tcgetattr(command) == before


def test_a_pipe_has_no_foreground() -> None:
    out, into = os.pipe()
    try:
        assert not in_foreground(out)
    finally:
        os.close(out)
        os.close(into)

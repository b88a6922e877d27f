"""``fti ground`` and ``fti watch --router``: wrong arguments, a router that is not there."""

from __future__ import annotations

import pytest

from fti.bus.loopback import choose_port
from fti.cli.main import main
from fti.publish.sinks import zenoh

ROUTER = "tcp/127.0.0.1:7447"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ground", "--connect", ROUTER, "--max-age", "nan"], "argument --max-age: 'nan': must be 0 to 600 seconds"),
        (["watch", "--router", ROUTER, "--max-age", "inf"], "argument --max-age: 'inf': must be 0 to 600 seconds"),
        (["ground", "--connect", ROUTER, "--port", "65536"], "argument --port: '65536': must be a whole number"),
    ],
)
def test_a_wrong_argument_is_refused(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """With a limit that is no number, no value would ever be late."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("command", [["ground", "--connect"], ["watch", "--router"]])
def test_an_absent_router_is_one_sentence(
    command: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zenoh, "CONNECT_TIMEOUT_MS", 200)
    endpoint = f"tcp/127.0.0.1:{choose_port(0)}"
    assert main([*command, endpoint]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"fti: {endpoint}: Unable to connect") and ".rs" not in error

"""The display process: how it begins and the ways in which it ends."""

import signal
import urllib.request
from collections.abc import Iterator

import pytest

from tests.helpers import until
from tests.web.fake_feed import DisplayProcess, FakeDaemon


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    made = FakeDaemon()
    yield made
    made.close()


@pytest.fixture
def display(daemon: FakeDaemon) -> Iterator[DisplayProcess]:
    made = DisplayProcess(daemon)
    yield made
    made.close()


@pytest.fixture(autouse=True)
def _started(daemon: FakeDaemon, display: DisplayProcess) -> None:
    daemon.start()


def end_of(display: DisplayProcess) -> int:
    until(lambda: display.process.poll() is not None, what="the display to exit")
    return int(display.process.returncode)


def test_it_serves_the_page_at_the_port_it_names(display: DisplayProcess) -> None:
    with urllib.request.urlopen(display.url, timeout=120) as response:
        assert b"<title>fti</title>" in response.read()


def test_it_ends_when_told(display: DisplayProcess) -> None:
    display.control.sendall(b'{"stop": true}\n')
    assert end_of(display) == 0


def test_it_ends_with_its_supervisor(display: DisplayProcess) -> None:
    display.control.close()
    assert end_of(display) == 0


def test_sigterm_ends_it_and_sigint_does_not(display: DisplayProcess) -> None:
    display.process.send_signal(signal.SIGINT)
    with urllib.request.urlopen(display.url, timeout=120) as response:
        assert response.status == 200
    assert display.process.poll() is None
    display.process.send_signal(signal.SIGTERM)
    assert end_of(display) == 0


def test_a_port_in_use_is_one_sentence(
    daemon: FakeDaemon, display: DisplayProcess, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ConnectionError, match="the display ended"):
        DisplayProcess(daemon, display.port)
    found = capfd.readouterr().err
    assert found.startswith(f"fti display: display.port = {display.port}: cannot be served on 127.0.0.1")
    assert found.count("\n") == 1


def test_a_missing_bus_is_one_sentence(daemon: FakeDaemon, capfd: pytest.CaptureFixture[str]) -> None:
    daemon.hub.endpoint = "tcp/127.0.0.1:1"
    with pytest.raises(ConnectionError, match="the display ended"):
        DisplayProcess(daemon)
    assert capfd.readouterr().err == "fti display: no bus at tcp/127.0.0.1:1; is the daemon running?\n"

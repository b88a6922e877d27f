"""``fti page``: the page with the owner's key, which stands on no command line."""

import webbrowser
from pathlib import Path

import pytest

from fti.cli.main import main
from tests.run_dirs import running_daemon

PAGE = "http://127.0.0.1:8123/#key=k-of_this_start"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What a browser was given on its command line."""
    texts: list[str] = []

    def remember(url: str) -> bool:
        texts.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", remember)
    return texts


def test_the_browser_gets_the_name_of_a_file_that_only_its_owner_can_read(tmp_path: Path, opened: list[str]) -> None:
    with running_daemon(tmp_path / "run", page=PAGE) as directory:
        assert main(["page", "--run-dir", str(directory.path)]) == 0
        file = directory.path / "page.html"
        assert opened == [f"file://{file}"]
        assert file.stat().st_mode & 0o777 == 0o600
        assert f'content="0; url={PAGE}"' in file.read_text()
    assert not file.exists()


def test_the_address_is_printed_on_demand(
    tmp_path: Path, opened: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with running_daemon(tmp_path, page=PAGE):
        assert main(["page", "--print", "--run-dir", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"{PAGE}\n"
    assert opened == []


def test_without_a_daemon_a_page_or_a_browser_it_reports_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda url: False)
    arguments = ["page", "--run-dir", str(tmp_path)]
    assert main(arguments) == 2
    assert capsys.readouterr().err == f"fti: {tmp_path}: no daemon is running there; start it with: fti run CONFIG\n"
    with running_daemon(tmp_path):
        assert main(arguments) == 2
    assert "serves no page: display.enabled is false" in capsys.readouterr().err
    with running_daemon(tmp_path, page=PAGE):
        assert main(arguments) == 2
    assert capsys.readouterr().err == "fti: cannot open a browser; fti page --print prints the address\n"

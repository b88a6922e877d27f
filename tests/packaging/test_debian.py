"""The Debian package: installed, used by an ordinary user, removed without a trace."""

from __future__ import annotations

import gzip
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import ROOT
from tests.packaging.conftest import Build
from tests.packaging.user import User, is_new_enough, make_home

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(
        os.geteuid() != 0 or not shutil.which("dpkg-deb") or not is_new_enough("/usr/bin/python3"),
        reason="a Debian package is installed by root, on a Debian with Python 3.11 or newer",
    ),
]


@pytest.fixture(scope="module")
def user(wheel: Path, build: Build) -> Iterator[User]:
    """A user of the installed package; it is removed in the end."""
    os.environ["PYTHON"] = sys.executable
    build(ROOT / "packaging" / "build_deb", wheel, wheel.parent)
    (package,) = wheel.parent.glob("*.deb")
    build("dpkg", "--install", package)
    try:
        with make_home() as home:
            yield User(home, Path("/usr/bin"))
    finally:
        build("dpkg", "--remove", "fti")
    assert not Path("/opt/fti").exists()


def test_the_command_flies_and_records(user: User) -> None:
    user.run("fti", "examples", "copy", "bench", "mine")
    user.run("fti", "run", "mine/bench.toml", "--duration", "1", "--out", "data")
    (session,) = (user.home / "data").iterdir()
    assert "all holds" in user.run("fti", "verify", str(session))


def test_manual_pages_and_completions_are_where_debian_looks(user: User) -> None:
    page = gzip.decompress(Path("/usr/share/man/man1/fti-run.1.gz").read_bytes()).decode()
    assert page.startswith(".TH FTI\\-RUN 1")
    completions = Path("/usr/share/bash-completion/completions/fti")
    shown = user.run("bash", "-c", f"source {completions}; complete -p fti")
    assert shown.endswith(" fti\n")
    assert Path("/usr/share/zsh/vendor-completions/_fti").read_text().startswith("#compdef fti\n")
    assert Path("/usr/share/fish/vendor_completions.d/fti.fish").is_file()


def test_the_service_starts_the_installed_command(user: User) -> None:
    unit = Path("/lib/systemd/system/fti.service").read_text()
    (command,) = [
        line.removeprefix("ExecStart=").split()[0] for line in unit.splitlines() if line.startswith("ExecStart=")
    ]
    assert Path(command).resolve() == Path("/opt/fti/bin/fti")

"""The wheel, installed without the repository and used by an ordinary user in a folder of his own."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.e2e.harness import with_free_ports
from tests.helpers import ROOT
from tests.packaging.conftest import Build
from tests.packaging.user import User, interpreter, make_home

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(1800)]


@pytest.fixture(scope="module")
def user(wheel: Path, build: Build) -> Iterator[User]:
    """The user, after the wheel and its dependencies were installed, and nothing else."""
    with make_home() as home:
        environment = home.parent / "environment"
        build(interpreter(), "-m", "venv", "--without-pip", environment)
        pip = (sys.executable, "-m", "pip", "--python", environment / "bin" / "python", "--disable-pip-version-check")
        build(*pip, "install", "--root-user-action", "ignore", "--only-binary", ":all:", wheel)
        yield User(home, environment / "bin")


@pytest.fixture(scope="module")
def session(user: User) -> Path:
    """A session of the demonstration, which is the first thing that a user runs."""
    user.run("fti", "demo", "--headless", "--duration", "12", "--out", "data")
    (path,) = (user.home / "data").iterdir()
    return path


@pytest.fixture(scope="module")
def configs(user: User) -> Path:
    """The examples; the demonstration on free ports, because other tests may run beside."""
    user.run("fti", "examples", "copy", "all", "configs")
    demo = user.home / "configs" / "demo.toml"
    demo.write_text(with_free_ports(demo.read_text()))
    return user.home / "configs"


def files(folder: Path) -> dict[Path, bytes]:
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_every_example_comes_with_the_package(user: User) -> None:
    user.run("fti", "examples", "copy", "all", "examples")
    assert files(user.home / "examples") == files(ROOT / "configs")


def test_manual_pages_are_beside_the_command(user: User) -> None:
    """``man`` searches share/man beside each bin of PATH."""
    shared = user.programs.parent / "share"
    pages = {path.name for path in (shared / "man" / "man1").iterdir()}
    assert pages >= {"fti.1", "fti-run.1", "fti-check.1"}
    assert (shared / "bash-completion" / "completions" / "fti").is_file()


def test_every_scenario_is_known_by_name(user: User) -> None:
    listed = [line.split()[0] for line in user.run("fti", "hil", "--list").splitlines()]
    assert listed == sorted(file.stem for file in (ROOT / "configs" / "scenarios").glob("*.toml"))


def test_the_demonstration_is_recorded_whole(user: User, session: Path) -> None:
    assert "all holds" in user.run("fti", "verify", str(session))


def test_reprocess_repeats_the_outputs(user: User, session: Path) -> None:
    user.run("fti", "reprocess", str(session), "--as-flown", "--out", "again")
    (again,) = (user.home / "again").iterdir()
    assert "all holds" in user.run("fti", "verify", str(again))


def test_export_writes_tables(user: User, session: Path) -> None:
    user.run("fti", "export", str(session), "--format", "parquet", "--out", "tables")
    assert pq.read_table(user.home / "tables" / "gnss_position.parquet").num_rows > 0


def test_score_compares_with_the_truth(user: User, session: Path) -> None:
    """A busy machine is late, which is no fault of the package: exit code 1."""
    (result,) = json.loads(user.run("fti", "score", "nominal", str(session), "--json", codes=(0, 1)))
    assert {row["topic"] for row in result["outputs"]} >= {"/nav/nav_solution", "/ahrs/attitude"}


def test_the_emulator_feeds_a_daemon(user: User, configs: Path) -> None:
    arguments = ("hil", f"{configs}/scenarios/nominal.toml", "--links", "links", "--duration", "5", "--wait")
    with user.running("fti", *arguments, ready="ready"):
        user.run("fti", "run", f"{configs}/demo.toml", "--links", "links", "--out", "own", "--duration", "10")
    (path,) = (user.home / "own").iterdir()
    assert recorded_bytes(user, path)["ins_eth"] > 0


def test_a_replay_sends_the_recorded_bytes(user: User, session: Path, configs: Path) -> None:
    arguments = ("replay", str(session), "--links", "again_links", "--config", f"{configs}/demo.toml")
    with user.running("fti", *arguments, ready="ready"):
        daemon = ("--links", "again_links", "--origin", "replay", "--out", "replayed", "--duration", "30")
        user.run("fti", "run", f"{configs}/demo.toml", *daemon)
    (path,) = (user.home / "replayed").iterdir()
    sent, received = recorded_bytes(user, session), recorded_bytes(user, path)
    assert received["ins_eth"] == sent["ins_eth"] > 0


def recorded_bytes(user: User, session: Path) -> dict[str, int]:
    """Recorded bytes of each link."""
    topics = json.loads(user.run("fti", "info", str(session), "--json"))["topics"]
    return {
        topic["topic"].removeprefix("/raw/"): topic["bytes"] for topic in topics if topic["topic"].startswith("/raw/")
    }


def test_decode_reads_a_capture(user: User) -> None:
    capture = shutil.copy(ROOT / "tests" / "captures" / "ublox-8.log", user.home / "capture.log")
    *_, counters = user.run("fti", "decode", str(capture), "--driver", "nmea0183", "--json").splitlines()
    assert json.loads(counters)["counters"]["framed"] > 0


def test_a_study_prints_its_target(user: User) -> None:
    result = json.loads(user.run("fti", "study", "device_clock", "--runs", "2", "--json"))
    assert result


def test_a_missing_extra_is_named(user: User) -> None:
    process = user.start("fti", "hil", "jsbsim_approach", "--plot", "flight.png")
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (
        2,
        'fti: flights with kind = "jsbsim" need JSBSim: pip install "fti[jsbsim]"\n',
    )

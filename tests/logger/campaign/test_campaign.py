"""Open files under damage: no byte is taken away, nothing altered is verified, no exit code is wrong."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from fti.logger.recovery.close_unfinished import close_all
from tests.helpers import ROOT
from tests.logger.campaign.campaign import QUICK, cases, generated_session, run_cases
from tests.logger.campaign.commands import fti
from tests.logger.campaign.damage import KINDS, DamagedFile
from tests.logger.campaign.mcap_parser import ParsedFile
from tests.logger.campaign.open_sessions import SHAPES, OpenSession, make_open_session
from tests.logger.campaign.rules import ClosingCheck, Truth

SEED = 20260102
FULL_SEED = 31


def test_open_files_under_damage(scale: int) -> None:
    """With ``--scale full`` 1000 flips, 300 zeroed pages, 300 cuts, 150 power cuts and 60 kills."""
    if scale > 1:
        command = [sys.executable, "-m", "tests.logger.campaign.campaign", "--seed", str(FULL_SEED), "--full"]
        done = subprocess.run([*command, "--processes", "2"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
        print(done.stdout)
        assert done.returncode == 0, done.stdout
        return
    total = run_cases(cases(SEED, QUICK))
    assert not total.failures, "\n".join(total.lines())


def test_every_kind_of_damage_is_in_the_quick_campaign() -> None:
    assert {case.kind for case in cases(SEED, QUICK)} == KINDS.keys()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
def test_a_kill_alone_costs_nothing(tmp_path: Path, shape: object) -> None:
    """The file is closed, holds what was there, and its session has nothing but the end that nobody wrote."""
    assert shape in SHAPES
    session = make_open_session(tmp_path / "made", SHAPES[SHAPES.index(shape)], Random(SEED))
    folder = session.put(tmp_path / "data", session.data)
    (closed,) = close_all(tmp_path / "data")
    assert closed.fault is None
    assert closed.messages == len(session.parsed.messages)
    assert fti("verify", folder).code == 3
    assert fti("recover", "--in-place", folder).out.strip().endswith("is finished")


# ------------------------------------------------------------------------------- the rules find what they are there for


@pytest.fixture(scope="module")
def killed() -> OpenSession:
    return next(
        session
        for case in cases(SEED, {"kill": 50})
        if (session := generated_session(case)).shape == "chunks" and len(session.files) == 1
    )


def _check(folder: Path, session: OpenSession, reported: str = "") -> list[str]:
    return ClosingCheck(Truth(session, DamagedFile(session.data, "")), folder).run(reported)


def _closed(session: OpenSession, directory: Path) -> Path:
    folder = session.put(directory, session.data)
    close_all(directory)
    assert not _check(folder, session, "something"), "the untouched one is good"
    return folder / session.open_name


def test_a_byte_that_is_gone_is_found(killed: OpenSession, tmp_path: Path) -> None:
    path = _closed(killed, tmp_path)
    message = killed.parsed.messages[len(killed.parsed.messages) // 2]
    data = bytearray(path.read_bytes())
    data[message.end - 1] ^= 1
    path.write_bytes(data)
    faults = _check(path.parent, killed)
    assert any("bytes are missing" in fault for fault in faults)
    assert any("official reader refuses" in fault for fault in faults)


def test_a_closed_file_that_ends_early_is_found(killed: OpenSession, tmp_path: Path) -> None:
    """What closing did before: it cut the file at the first record that made no sense."""
    at = killed.parsed.messages[len(killed.parsed.messages) // 2].begin
    folder = killed.put(tmp_path, killed.data[:at])
    close_all(tmp_path)
    for path in folder.glob("*.bin"):
        path.unlink()
    assert any("bytes are missing" in fault for fault in _check(folder, killed, "something"))


def test_a_file_left_alone_without_a_word_is_found(killed: OpenSession, tmp_path: Path) -> None:
    folder = killed.put(tmp_path, killed.data)
    assert _check(folder, killed) == ["closing: the file was left alone, and nobody says so"]


def test_the_parser_knows_where_a_byte_stands(killed: OpenSession) -> None:
    parsed: ParsedFile = killed.parsed
    for message in parsed.messages[:50]:
        assert parsed.message_at(message.begin) == parsed.message_at(message.end - 1) == message

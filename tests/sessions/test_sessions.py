"""Sessions that earlier versions have recorded: they are read, verified, and give the same outputs again.

Bits may depend on the processor model, so numbers are compared in physical units: 1 mm of position, a millionth of any
other quantity.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.logger.reading.recording import Recording
from fti.post.reprocess import recorded_setup, reprocess
from tests.sessions.record import FOLDER, KINDS

SESSIONS = sorted(path for path in FOLDER.glob("*/*/*_0") if path.is_dir())
ANGLE_RAD, RELATIVE = 1.5e-10, 1e-6
#: Angles of a position on the ellipsoid: 1.5e-10 rad are 1 mm.
ANGLES = frozenset({"lat", "lon"})
#: The hash of a scene's posts: their last bits depend on the processor model.
IGNORED = frozenset({"sha256"})
#: Fields that a later version has added: checksums of the terrain, motion of ``/nav/location``.
ADDED = frozenset({"checksums", "heading", "velocity"})
#: Numbers that a later version computes otherwise, by topic: 0.3.0 trusts the climb of satellites less.
COMPUTED_OTHERWISE = {"/nav/vertical_solution": ("alt", "vertical_sd", "vel_down", "vel_down_sd")}
Messages = defaultdict[tuple[str, int], list[Any]]


def version_and_kind(session: Path) -> str:
    """As they are recorded: VERSION/KIND/SESSION."""
    return "/".join(session.relative_to(FOLDER).parts[:2])


def test_there_is_one_of_each_kind_of_each_version() -> None:
    versions = {session.parent.parent.name for session in SESSIONS}
    assert "0.1.0" in versions
    assert {version_and_kind(session) for session in SESSIONS} == {f"{v}/{kind}" for v in versions for kind in KINDS}


@pytest.mark.parametrize("session", SESSIONS, ids=version_and_kind)
def test_it_is_read_and_verified(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert Recording.open(session).metadata["fti"]["software"] == session.parent.parent.name
    assert main(["info", str(session)]) == 0
    assert session.name in capsys.readouterr().out
    assert main(["verify", str(session)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("all holds: 2 files, ")


@pytest.mark.parametrize("session", SESSIONS, ids=version_and_kind)
def test_it_gives_the_same_measurements_and_outputs_again(session: Path, tmp_path: Path) -> None:
    recording = Recording.open(session)
    setup = recorded_setup(recording, session)
    again = reprocess(recording, setup, tmp_path, as_flown=True, progress=lambda seq: None)
    new, old = messages(Recording.open(again)), messages(recording)
    assert sum(len(rows) for (topic, _), rows in old.items() if topic == "/nav/nav_solution") > 250
    missing = [
        difference(row, new[key], key)
        for key, rows in old.items()
        for row in rows
        if not any(is_same(row, other) for other in new[key])
    ]
    assert not missing, missing[:3]
    assert count_outputs(new) == count_outputs(old)


def count_outputs(result: Messages) -> dict[tuple[str, int], int]:
    """How many outputs there are of each topic and time."""
    return {key: len(rows) for key, rows in result.items() if rows and key[0].startswith("/nav/")}


def messages(recording: Recording) -> Messages:
    """What the derived files hold, by topic and time [ns]; of numbers computed otherwise, whether they exist."""
    result: Messages = defaultdict(list)
    for topic, t_ns, _, _, data in recording.messages():
        row = json.loads(data)
        row |= {name: row[name] is not None for name in COMPUTED_OTHERWISE.get(topic, ())}
        result[topic, t_ns].append(row)
    return result


def difference(row: Any, others: list[Any], key: tuple[str, int]) -> str:
    """Where a message that is not there again differs from the first one of the same topic and time."""
    text = "; ".join(unequal(row, others[0])) if others else "no message"
    return f"{key[0]} at {key[1]}: {text}"


def unequal(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Keys whose values differ."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() <= other.keys() <= one.keys() | ADDED:
        for key, value in ((key, value) for key, value in one.items() if key not in IGNORED):
            yield from unequal(value, other[key], f"{where}.{key}" if where else key)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for n, (mine, yours) in enumerate(zip(one, other, strict=True)):
            yield from unequal(mine, yours, f"{where}[{n}]")
    elif isinstance(one, float) and isinstance(other, float):
        last = where.rpartition(".")[2]
        tolerance = ANGLE_RAD if last in ANGLES else RELATIVE * max(1.0, abs(one))
        if not math.isclose(one, other, rel_tol=0.0, abs_tol=tolerance):
            yield f"{where}: {one!r}, now {other!r}"
    elif one != other or isinstance(one, bool) is not isinstance(other, bool):
        yield f"{where}: {one!r}, now {other!r}"


def is_same(one: Any, other: Any) -> bool:
    """No key differs."""
    return next(unequal(one, other), None) is None


def test_a_difference_is_seen() -> None:
    row = {"lat": 0.6, "valid": True, "reasons": ["stale"], "sd": None, "height": 100.0}
    assert is_same(row, {**row, "lat": 0.6 + 1e-10, "height": 100.00001})
    changes: list[dict[str, Any]] = [
        {"lat": 0.6 + 2e-10},
        {"valid": 1},
        {"reasons": []},
        {"sd": 0.0},
        {"height": 100.001},
    ]
    for change in changes:
        assert not is_same(row, {**row, **change})
    assert is_same(row, {**row, "heading": 1.0}) and not is_same({**row, "heading": 1.0}, row)
    assert not is_same(row, {**row, "new": 1.0})

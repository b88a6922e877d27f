"""``fti score``: a session that holds, sessions that were doctored, and wrong calls."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fti.cli.main import main
from fti.logger.reading.mcap_file import Item, McapFile
from fti.logger.stream_writer import StreamWriter
from tests.post.score.flying import daemon_config, session_of, short

FAULT = {"kind": "cut", "devices": ("altimeter",), "from_s": 10.0, "to_s": 13.0}
SCENARIO = """
title = "test"
description = ""
config = "short.toml"
seed = {seed}

[flight]
duration_s = 38

[[fault]]
kind = "cut"
devices = ["altimeter"]
from_s = 10
to_s = 13
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scenario.toml and out/SESSION."""
    folder = tmp_path_factory.mktemp("flown")
    (folder / "scenario.toml").write_text(SCENARIO.format(seed=1))
    (folder / "other.toml").write_text(SCENARIO.format(seed=2))
    daemon_config(folder)
    session_of(short((FAULT,)), folder)
    return folder


def session(folder: Path) -> Path:
    (found,) = (folder / "out").iterdir()
    return found


def doctored(folder: Path, out: Path, change: Callable[[Item], bytes]) -> Path:
    """A copy of a session whose derived messages were changed."""
    copy = out / session(folder).name
    shutil.copytree(session(folder), copy)
    (file,) = copy.glob("*_derived_000.mcap")
    source, channels = McapFile(session(folder) / file.name), dict[str, int]()
    file.unlink()
    writer = StreamWriter(file)
    for name, table in source.head().metadata.items():
        writer.add_metadata(name, table)
    for item in source.items():
        if item.topic.name not in channels:
            channels[item.topic.name] = writer.add_channel(item.topic.name, item.topic.encoding)
        writer.write(channels[item.topic.name], item.log_time, change(item), 0, item.publish_time)
    writer.close()
    return copy


def reasons_become(change: Callable[[set[str]], set[str]]) -> Callable[[Item], bytes]:
    """Other reasons against every height."""

    def changed(item: Item) -> bytes:
        if not item.topic.name.startswith("/nav/height"):
            return item.data
        content = json.loads(item.data)
        return json.dumps({**content, "reasons": sorted(change(set(content["reasons"])))}).encode()

    return changed


def test_a_session_that_holds(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", str(flown / "scenario.toml"), str(session(flown))]) == 0
    out = capsys.readouterr().out
    assert "1 cable cut, 10.0-13.0 s  altimeter  /nav/height_above_ground/altimeter stale  found" in out
    assert out.splitlines()[-1].startswith("holds: 1 of 1 expected flags found in time; nothing")


def test_a_doctored_session_misses_the_flag(flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = doctored(flown, tmp_path, reasons_become(lambda told: told - {"stale"}))
    assert main(["score", str(flown / "scenario.toml"), str(wrong)]) == 1
    assert "altimeter stale  missing" in capsys.readouterr().out


def test_a_flag_that_never_goes_is_told(flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = doctored(flown, tmp_path, reasons_become(lambda told: told | {"stale"}))
    assert main(["score", str(flown / "scenario.toml"), str(wrong), "--json"]) == 1
    (told,) = json.loads(capsys.readouterr().out)
    assert told["rows"][0]["verdict"] == "does not clear"
    assert {one["word"] for one in told["unexpected"]} == {"stale"}


def test_another_scenario_is_refused(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", str(flown / "other.toml"), str(session(flown))]) == 2
    assert "they differ in seed" in capsys.readouterr().err


def test_without_a_truth_it_says_how_to_get_one(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / session(flown).name
    shutil.copytree(session(flown), copy)
    (truth,) = copy.glob("*_truth_*")
    apart = truth.rename(tmp_path / "apart.mcap")
    assert main(["score", str(flown / "scenario.toml"), str(copy)]) == 2
    assert "fti hil SCENARIO --truth FILE" in capsys.readouterr().err
    assert main(["score", str(flown / "scenario.toml"), str(copy), "--truth", str(apart)]) == 0


def test_what_is_no_truth_is_refused(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (raw,) = (
        path for path in session(flown).glob("*_000.mcap") if "derived" not in path.name and "truth" not in path.name
    )
    assert main(["score", str(flown / "scenario.toml"), str(session(flown)), "--truth", str(raw)]) == 2
    assert "is no truth of the emulator" in capsys.readouterr().err


def test_a_picture_is_drawn_once(flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["score", str(flown / "scenario.toml"), str(session(flown)), "--plot", str(tmp_path / "score.svg")]
    assert main(command) == 0
    assert "cable cut" in (tmp_path / "score.svg").read_text()
    assert main(command) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_junit_says_what_failed_and_is_written_once(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = doctored(flown, tmp_path, reasons_become(lambda told: told - {"stale"}))
    command = ["score", str(flown / "scenario.toml"), str(wrong), "--junit", str(tmp_path / "score.xml")]
    assert main(command) == 1
    (failed,) = ElementTree.parse(tmp_path / "score.xml").iterfind(".//testcase[failure]")
    assert failed.attrib["name"].endswith("/nav/height_above_ground/altimeter stale")
    capsys.readouterr()
    assert main(command) == 2
    assert "score.xml: cannot be written: File exists" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [[], ["--fly", "somewhere", "session"], ["session", "--plot", "score.pdf"]])
def test_wrong_calls(flown: Path, wrong: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["score", str(flown / "scenario.toml"), *wrong])
    assert ended.value.code == 2


def test_accelerated_flights_are_the_same(flown: Path, tmp_path: Path) -> None:
    again = session_of(short((FAULT,)), tmp_path)
    for file in sorted(session(flown).iterdir()):
        assert (again / file.name).read_bytes() == file.read_bytes(), file.name

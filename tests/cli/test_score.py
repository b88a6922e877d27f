"""``fti score``: a session that holds, sessions that were doctored, and wrong calls."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fti.cli._score_jobs import split_names
from fti.cli.main import main
from fti.hil import scenario as scenarios
from fti.logger.reading.mcap_file import McapFile, McapMessage
from fti.logger.stream_writer import StreamWriter
from tests.post.score.short_flight import daemon_config, session_of, short_scenario

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
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scenario.toml and out/SESSION."""
    folder = tmp_path_factory.mktemp("flown")
    (folder / "scenario.toml").write_text(SCENARIO.format(seed=1))
    (folder / "other.toml").write_text(SCENARIO.format(seed=2))
    daemon_config(folder)
    session_of(short_scenario((FAULT,)), folder)
    return folder


def session(folder: Path) -> Path:
    (found,) = (folder / "out").iterdir()
    return found


def doctored(folder: Path, out: Path, change: Callable[[McapMessage], bytes]) -> Path:
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


def reasons_become(change: Callable[[set[str]], set[str]]) -> Callable[[McapMessage], bytes]:
    """Other reasons against every height."""

    def changed(item: McapMessage) -> bytes:
        if not item.topic.name.startswith("/nav/height"):
            return item.data
        content = json.loads(item.data)
        return json.dumps({**content, "reasons": sorted(change(set(content["reasons"])))}).encode()

    return changed


def test_a_session_that_holds(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", str(recorded / "scenario.toml"), str(session(recorded))]) == 0
    out = capsys.readouterr().out
    assert "1 cable cut, 10.0-13.0 s  altimeter  /nav/height_above_ground/altimeter stale  found" in out
    conclusion = r"holds: 1 of 1 expected flags found in time; (\d+) of \1 checks of outputs hold; no unexpected flags"
    assert re.match(conclusion, out.splitlines()[-1])


def test_a_doctored_session_misses_the_flag(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = doctored(recorded, tmp_path, reasons_become(lambda reasons: reasons - {"stale"}))
    assert main(["score", str(recorded / "scenario.toml"), str(wrong)]) == 1
    assert "altimeter stale  missing" in capsys.readouterr().out


def test_a_flag_that_never_goes_is_reported(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = doctored(recorded, tmp_path, reasons_become(lambda reasons: reasons | {"stale"}))
    assert main(["score", str(recorded / "scenario.toml"), str(wrong), "--json"]) == 1
    (printed,) = json.loads(capsys.readouterr().out)
    assert printed["rows"][0]["verdict"] == "does not clear"
    assert {one["word"] for one in printed["unexpected"]} == {"stale"}


def test_another_scenario_is_refused(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", str(recorded / "other.toml"), str(session(recorded))]) == 2
    assert "they differ in seed" in capsys.readouterr().err


def test_without_a_truth_it_names_the_option(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / session(recorded).name
    shutil.copytree(session(recorded), copy)
    (truth,) = copy.glob("*_truth_*")
    apart = truth.rename(tmp_path / "apart.mcap")
    assert main(["score", str(recorded / "scenario.toml"), str(copy)]) == 2
    assert "fti hil SCENARIO --truth FILE" in capsys.readouterr().err
    assert main(["score", str(recorded / "scenario.toml"), str(copy), "--truth", str(apart)]) == 0


def test_what_is_no_truth_is_refused(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (raw,) = (
        path for path in session(recorded).glob("*_000.mcap") if "derived" not in path.name and "truth" not in path.name
    )
    assert main(["score", str(recorded / "scenario.toml"), str(session(recorded)), "--truth", str(raw)]) == 2
    assert "is not a truth file of the emulator" in capsys.readouterr().err


def test_a_picture_is_drawn_once(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["score", str(recorded / "scenario.toml"), str(session(recorded)), "--plot", str(tmp_path / "score.svg")]
    assert main(command) == 0
    assert "cable cut" in (tmp_path / "score.svg").read_text()
    with pytest.raises(SystemExit, match="2"):
        main(command)
    assert "already exists" in capsys.readouterr().err


def test_junit_reports_what_failed_and_is_written_once(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = doctored(recorded, tmp_path, reasons_become(lambda reasons: reasons - {"stale"}))
    command = ["score", str(recorded / "scenario.toml"), str(wrong), "--junit", str(tmp_path / "score.xml")]
    assert main(command) == 1
    (failed,) = ElementTree.parse(tmp_path / "score.xml").iterfind(".//testcase[failure]")
    assert failed.attrib["name"].endswith("/nav/height_above_ground/altimeter stale")
    capsys.readouterr()
    with pytest.raises(SystemExit, match="2"):
        main(command)
    assert "score.xml: already exists; choose another name" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [[], ["--fly", "somewhere", "SESSION"], ["SESSION", "--plot", "score.pdf"]])
def test_wrong_calls(recorded: Path, wrong: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "score",
                str(recorded / "scenario.toml"),
                *(str(session(recorded)) if w == "SESSION" else w for w in wrong),
            ]
        )
    assert ended.value.code == 2


# ------------------------------------------------------------------------------------------------- several in one call

LATER = {**FAULT, "from_s": 20.0, "to_s": 23.0}


@pytest.fixture(scope="module")
def several(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Two scenarios and their sessions."""
    folder = tmp_path_factory.mktemp("several")
    daemon_config(folder)
    text = SCENARIO.format(seed=1).replace("from_s = 10\nto_s = 13", "from_s = 20\nto_s = 23")
    (folder / "later.toml").write_text(text.replace('"test"', '"later"'))
    later = session_of(short_scenario((LATER,), title="later"), folder)
    scenarios = {"scenario": str(recorded / "scenario.toml"), "later": str(folder / "later.toml")}
    return {**scenarios, "session": str(session(recorded)), "later_session": str(later)}


def test_each_session_is_scored_by_the_scenario_that_was_flown(
    several: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = (several[name] for name in ("scenario", "later", "later_session", "session"))
    assert main(["score", *names, "--junit", str(tmp_path / "all.xml")]) == 0
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1] == "2 flights: 2 holds"
    test, later = (line.split() for line in printed.out.splitlines()[-4:-2])
    assert (test[:2], later[:2]) == (["test", "holds"], ["later", "holds"])
    assert [line.split(":")[0] for line in printed.err.splitlines()] == ["1 of 2", "2 of 2"]
    assert len(ElementTree.parse(tmp_path / "all.xml").findall("testsuite")) == 2


def test_one_that_fails_is_reported_beside_one_that_holds(
    several: dict[str, str], recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = str(doctored(recorded, tmp_path, reasons_become(lambda reasons: reasons - {"stale"})))
    assert main(["score", several["scenario"], several["later"], wrong, several["later_session"], "--json"]) == 1
    assert [one["outcome"] for one in json.loads(capsys.readouterr().out)] == ["failed", "holds"]


def test_a_session_alone_is_scored_by_the_shipped_scenario_that_its_truth_names(
    several: dict[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["score", several["session"]]) == 2
    refused = capsys.readouterr().err
    assert "is the truth of 'test', seed 1, and not of" in refused and "fti score SCENARIO.toml SESSION" in refused
    monkeypatch.setattr(scenarios, "shipped_names", lambda: [several["scenario"], several["later"]])
    assert main(["score", several["later_session"], "--json"]) == 0
    assert [one["scenario"] for one in json.loads(capsys.readouterr().out)] == ["later"]


def test_a_session_of_none_of_the_scenarios_is_refused(
    several: dict[str, str], recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = (several["later"], str(recorded / "other.toml"), several["later_session"], several["session"])
    assert main(["score", *names]) == 2
    printed = capsys.readouterr()
    assert "is the truth of 'test', seed 1, and not of the present version of any scenario" in printed.err
    assert (printed.out, len(printed.err.splitlines())) == ("", 1)


def test_a_scenario_without_a_session_is_refused(several: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", several["scenario"], several["later"], several["session"]]) == 2
    printed = capsys.readouterr()
    assert f"{several['later']}: no session belongs to this scenario" in printed.err
    assert (printed.out, len(printed.err.splitlines())) == ("", 1)


def test_a_flight_that_cannot_be_scored_does_not_hide_the_others(
    several: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blind = shutil.copytree(several["later_session"], tmp_path / "blind")
    (truth,) = blind.glob("*_truth_*")
    truth.unlink()
    names = (several["scenario"], several["later"], several["session"], str(blind))
    assert main(["score", *names, "--json", "--junit", str(tmp_path / "all.xml")]) == 2
    good, wrong = json.loads(capsys.readouterr().out)
    assert (good["outcome"], wrong["outcome"], wrong["scenario"]) == ("holds", "not compared", str(blind))
    assert "contains no truth file" in wrong["error"]
    assert len(list(ElementTree.parse(tmp_path / "all.xml").iter("error"))) == 1
    assert main(["score", *names]) == 2
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1] == "2 flights: 1 holds, 1 not compared"
    assert "contains no truth file" in printed.err


def test_several_are_flown_each_below_a_folder_of_its_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    daemon_config(tmp_path)
    for name, seed in (("one", 1), ("two", 2)):
        text = SCENARIO.format(seed=seed).replace("duration_s = 38", "duration_s = 14").replace('"test"', f'"{name}"')
        text = text.replace("to_s = 13", "to_s = 15" if name == "two" else "to_s = 13")
        (tmp_path / f"{name}.toml").write_text(text)
    files = [str(tmp_path / "one.toml"), str(tmp_path / "two.toml")]
    assert main(["score", *files, "--fly", str(tmp_path / "out"), "--json"]) == 0
    streams = capsys.readouterr()
    assert streams.err.count("warning: ") == 1
    assert "warning: fault[0], cable cut, ends at 15 s, but the flight ends at 14 s" in streams.err
    one, two = json.loads(streams.out)
    assert (one["scenario"], two["scenario"]) == ("one", "two")
    assert Path(one["truth"]).parents[1] == tmp_path / "out" / "one"
    assert Path(two["truth"]).parents[1] == tmp_path / "out" / "two"


def test_a_flight_that_cannot_be_flown_does_not_hide_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    daemon_config(tmp_path)
    text = SCENARIO.format(seed=1).replace("duration_s = 38", "duration_s = 14")
    (tmp_path / "good.toml").write_text(text)
    (tmp_path / "wrong.toml").write_text(text.replace('"altimeter"', '"nobody"'))
    files = [str(tmp_path / "wrong.toml"), str(tmp_path / "good.toml")]
    assert main(["score", *files, "--fly", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1] == "2 flights: 1 holds, 1 not compared"
    assert "fault[0].devices" in printed.err


def test_all_are_the_shipped_ones(several: dict[str, str]) -> None:
    assert split_names(["all"], True) == (scenarios.shipped_names(), [])
    assert split_names(["silence", "all"], True)[0].count("silence") == 1


def test_what_is_no_scenario_behind_one_is_a_session_that_is_not_there(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["score", str(recorded / "scenario.toml"), str(tmp_path / "nothing")]) == 2
    assert "there is no such session folder or file" in capsys.readouterr().err
    assert main(["score", "silense", "--fly", str(tmp_path)]) == 2
    assert "unknown scenario 'silense'" in capsys.readouterr().err


def test_the_session_of_an_accelerated_flight_names_software_and_configuration(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", "-v", str(session(recorded))]) == 0
    assert f"software  fti {version('fti')}, configuration short.toml " in capsys.readouterr().out


def test_accelerated_flights_are_the_same(recorded: Path, tmp_path: Path) -> None:
    again = session_of(short_scenario((FAULT,)), tmp_path)
    for file in sorted(session(recorded).iterdir()):
        assert (again / file.name).read_bytes() == file.read_bytes(), file.name

"""Reprocessing a small session that is written here: same outputs, and what navigation missed repeated or healed."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.cli.main import main
from fti.config import TerrainFiles
from fti.drivers import freeflight_ra4500 as ra
from fti.errors import ConfigError, RecordingError
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.topics import READMISSION_TOPIC, TERRAIN_TOPIC
from fti.post.reprocess import NavigationRun, other_setup, read_navigation_runs, recorded_setup, reprocess
from fti.service.navigation.terrain_loader import load_terrain
from tests.helpers import ROOT
from tests.small_config import LINE, radar_altimeter

CONFIG = LINE + radar_altimeter(max_age_ms=100) + '\n[nav]\naltimeters = ["altimeter"]\n'
START_NS = 1_700_000_000_000_000_000
TICK_NS = 20_000_000
FRAMES = 400


def _record(folder: Path, attachments: dict[str, str]) -> SessionFolder:
    """A height every 40 ms, a tick every 20 ms, and silence in the middle."""
    session = SessionFolder.create(folder, "small", START_NS)
    log = RawLog(
        session,
        [RawTopic("line", "serial", {})],
        LogSettings(
            split_s=60,
            split_mb=10,
            attachments=[(name, "text/plain", text.encode()) for name, text in attachments.items()],
        ),
    )
    seq = 0
    for i in range(FRAMES):
        t_ns = START_NS + i * TICK_NS
        if i % 2 == 0 and not 150 <= i < 250:
            log.write_frame("line", seq, t_ns, ra.encode_height(50.0 + i, ("in_air",), ra.Options()))
            seq += 1
        log.write_tick(seq, t_ns + 1)
        seq += 1
    log.close()
    return session


def _note_gaps(session: SessionFolder, gaps: list[dict[str, Any]]) -> None:
    log = DerivedLog(session, LogSettings(split_s=60, split_mb=10))
    for gap in gaps:
        log.write_table("/fti/gap", START_NS, {"t_ns": START_NS, **gap})
    log.close()


def _outputs(session: Path) -> list[tuple[str, int, bytes]]:
    return [(topic, log, data) for topic, log, _, _, data in Recording.open(session).messages("/nav/")]


def _again(session: SessionFolder, out: Path, *, as_flown: bool = False) -> Path:
    recording = Recording.open(session.path)
    setup = recorded_setup(recording, session.path)
    return reprocess(recording, setup, out, as_flown=as_flown, progress=lambda seq: None)


def test_twice_the_same_bytes(tmp_path: Path) -> None:
    session = _record(tmp_path, {"config.toml": CONFIG})
    first, second = _outputs(_again(session, tmp_path / "a")), _outputs(_again(session, tmp_path / "b"))
    heights = [json.loads(data) for topic, _, data in first if topic.endswith("/altimeter")]
    assert first == second
    assert {reason for row in heights for reason in row["reasons"]} >= {"stale"}
    assert sum(row["valid"] for row in heights) == 0  # no attitude is configured, and that is said
    assert len(heights) > 150


def test_no_frame_is_left_out_nor_taken_twice(tmp_path: Path) -> None:
    """Neither the first one of the flight, nor that at which another navigation process went on."""
    session = _record(tmp_path, {"config.toml": CONFIG})
    _note_gaps(session, [{"kind": "restart", "after_seq": 299, "before_seq": 300}])
    expected_ns = [frame.t_rx_ns for frame in Recording.open(session.path).frames() if frame.link == "line"]
    for as_flown in (False, True):
        again = _again(session, tmp_path / f"again_{as_flown}", as_flown=as_flown)
        heights = Recording.open(again).messages("/altimeter/radio_height")
        assert [t_ns for _, t_ns, *_ in heights] == expected_ns


def test_what_navigation_missed_is_repeated_or_healed(tmp_path: Path) -> None:
    session = _record(tmp_path, {"config.toml": CONFIG})
    _note_gaps(
        session,
        [
            {"kind": "ring", "after_seq": 99, "before_seq": 200},
            {"kind": "restart", "after_seq": 299, "before_seq": 300},
        ],
    )
    assert read_navigation_runs(Recording.open(session.path)) == [
        NavigationRun(0, 299, ((99, 200),)),
        NavigationRun(300, None),
    ]
    healed = _outputs(_again(session, tmp_path / "healed"))
    repeated = _outputs(_again(session, tmp_path / "flown", as_flown=True))
    assert len(repeated) < len(healed)
    assert repeated[:50] == healed[:50]
    missed = [f.t_rx_ns for f in Recording.open(session.path).frames() if 99 < f.seq < 200]
    assert not [t for _, t, _ in repeated if missed[0] <= t <= missed[-1]]
    assert [t for _, t, _ in healed if missed[0] <= t <= missed[-1]]


def _with_terrain(text: str) -> str:
    return text + 'terrain = { scene = "demo" }\n'


def test_the_terrain_is_there_from_the_frame_on_from_which_it_was_in_flight(tmp_path: Path) -> None:
    session = _record(tmp_path, {"config.toml": _with_terrain(CONFIG)})
    sha256 = load_terrain(TerrainFiles(scene="demo")).digest
    _note_terrain(session, {"t_ns": START_NS, "after_seq": 99, "name": "scene demo", "sha256": sha256})
    unchecked = [json.loads(data)["unchecked"] for topic, _, data in _outputs(_again(session, tmp_path / "again"))
            if topic.endswith("/altimeter")]  # fmt: skip
    loading = unchecked.index(["no_position"])
    assert unchecked[:loading] == [["terrain_loading"]] * loading
    assert 30 < loading < 40  # of 100 frames every third is a sample
    assert ["terrain_loading"] not in unchecked[loading:]


def test_a_terrain_that_could_not_be_read_in_flight_is_not_there_again(tmp_path: Path) -> None:
    session = _record(tmp_path, {"config.toml": _with_terrain(CONFIG)})
    _note_terrain(session, {"t_ns": START_NS, "after_seq": 99, "fault": "the files were not there"})
    rows = [json.loads(data) for topic, _, data in _outputs(_again(session, tmp_path / "again"))]
    assert {reason for row in rows for reason in row.get("unchecked", ())} == {"terrain_loading", "no_terrain"}


def test_another_terrain_than_that_of_the_flight_is_refused(tmp_path: Path) -> None:
    session = _record(tmp_path, {"config.toml": _with_terrain(CONFIG)})
    note = {"t_ns": START_NS, "after_seq": 99, "name": "scene demo", "sha256": "0" * 64, "checksums": [1.0]}
    _note_terrain(session, note)
    with pytest.raises(RecordingError, match="is not the terrain of the flight"):
        _again(session, tmp_path / "again")


def test_last_bits_of_posts_do_not_make_another_terrain(tmp_path: Path) -> None:
    """The hash is that of another processor or version; the checksums are the same."""
    session = _record(tmp_path, {"config.toml": _with_terrain(CONFIG)})
    checksums = load_terrain(TerrainFiles(scene="demo")).checksums
    note = {"t_ns": START_NS, "after_seq": 99, "name": "scene demo", "sha256": "0" * 64, "checksums": list(checksums)}
    _note_terrain(session, note)
    assert _again(session, tmp_path / "again").is_dir()


def test_checksums_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    session = _record(tmp_path, {"config.toml": _with_terrain(CONFIG)})
    _note_terrain(session, {"t_ns": START_NS, "after_seq": 99, "name": "scene demo", "checksums": ["many"]})
    with pytest.raises(RecordingError, match=r"/fti/terrain: the message at .* cannot be used: .*many"):
        _again(session, tmp_path / "again")


@pytest.mark.parametrize("as_flown", [False, True])
def test_a_readmission_is_repeated_behind_the_frame_behind_which_it_came(tmp_path: Path, as_flown: bool) -> None:
    config = CONFIG.replace("[nav]\n", '[nav]\nposition = ["altimeter"]\n')
    session = _record(tmp_path, {"config.toml": config})
    frames = {frame.seq: frame.t_rx_ns for frame in Recording.open(session.path).frames()}
    log = DerivedLog(session, LogSettings(split_s=60, split_mb=10))
    log.write_table(READMISSION_TOPIC, START_NS, {"t_ns": frames[99] + 7, "after_seq": 99, "source": "altimeter"})
    log.close()
    again = Recording.open(_again(session, tmp_path / "again", as_flown=as_flown))
    (note,) = [json.loads(data) for *_, data in again.messages(READMISSION_TOPIC, kind="derived")]
    assert note == {"t_ns": frames[99] + 7, "after_seq": 99, "source": "altimeter"}
    events = [(t_ns, json.loads(data)) for _, t_ns, _, _, data in again.messages("/fti/event", kind="derived")]
    (readmitted_ns,) = [t_ns for t_ns, event in events if "nothing to readmit" in event["message"]]
    assert readmitted_ns == frames[99] + 7


def _note_terrain(session: SessionFolder, note: dict[str, Any]) -> None:
    log = DerivedLog(session, LogSettings(split_s=60, split_mb=10))
    log.write_table(TERRAIN_TOPIC, START_NS, note)
    log.close()


@given(st.lists(st.integers(1, 30), max_size=12), st.integers(0, 20), st.none() | st.integers(0, 300))
def test_a_segment_holds_what_lies_in_no_gap(widths: list[int], first: int, last: int | None) -> None:
    """Alternately so many frames seen and so many missed."""
    edges = list(itertools.accumulate(widths, initial=first))
    lost = tuple(zip(edges[1::2], edges[2::2], strict=False))
    segment = NavigationRun(first, last, lost)
    missed = {seq for after, before in lost for seq in range(after + 1, before)}
    for seq in range(400):
        assert segment.contains(seq) == (seq >= first and (last is None or seq <= last) and seq not in missed)
        assert segment.gaps_before(seq) == sum(after < seq for after, _ in lost)


def test_a_session_without_its_configuration_is_refused(tmp_path: Path) -> None:
    session = _record(tmp_path, {})
    with pytest.raises(RecordingError, match="contains no configuration"):
        _again(session, tmp_path / "out")


@pytest.mark.parametrize("by_note", [False, True])
def test_elevation_files_of_a_recording_are_local_ones_or_none(tmp_path: Path, by_note: bool) -> None:
    """Named in the configuration that it carries, or in the note of navigation; the user's own may name them."""
    vrt = tmp_path / "a.vrt"
    vrt.write_text('<VRTDataset rasterXSize="2" rasterYSize="2"/>')
    text = CONFIG + f'terrain = {{ files = ["{"other.tif" if by_note else vrt}"], vertical = "ellipsoid" }}\n'
    session = _record(tmp_path, {"config.toml": text})
    if by_note:
        _note_terrain(session, {"t_ns": START_NS, "after_seq": 99, "name": "a", "files": [str(vrt)]})
    with pytest.raises(ConfigError, match=r"a\.vrt: the recording names this elevation file.*give your own"):
        _again(session, tmp_path / "again")
    own = tmp_path / "own.toml"
    own.write_text(text.replace("other.tif", str(vrt)))
    with pytest.raises(ConfigError, match=r"a\.vrt: is not an elevation file that GDAL can read"):
        other_setup(str(own)).load_terrain()


@pytest.mark.parametrize(
    ("config", "error"),
    [
        (CONFIG, r"small_\S+: has no \[nav\.terrain_position\]"),
        (
            (ROOT / "configs" / "terrain_position.toml").read_text(),
            r"no height profile was complete: see ",
        ),
    ],
    ids=["without the table", "without a profile"],
)
def test_methods_cannot_be_compared(
    config: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = _record(tmp_path, {"config.toml": config})
    assert main(["reprocess", str(session.path), "--out", str(tmp_path / "a"), "--compare-terrain-methods"]) == 2
    assert re.search(error, capsys.readouterr().err)

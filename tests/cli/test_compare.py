"""``fti compare``: equal is equal, whatever the cuts of a serial line; anything else is not."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import SessionFolder

START_NS = 1_700_000_000_000_000_000
Frames = dict[str, list[bytes]]
LINKS = (("line", "serial"), ("eth", "udp"))
FRAMES: Frames = {"line": [b"abc", b"def"], "eth": [b"one", b"two"]}


def record(folder: Path, frames: Frames) -> str:
    session = SessionFolder.create(folder, "compared", START_NS)
    log = RawLog(
        session,
        [RawTopic(link, kind, {}) for link, kind in LINKS if link in frames],
        LogSettings(split_s=9, split_mb=9),
    )
    arrived = [(link, data) for link, all_of_it in frames.items() for data in all_of_it]
    for seq, (link, data) in enumerate(arrived):
        log.write_frame(link, seq, START_NS + seq, data)
    log.write_sent("eth", len(arrived), START_NS, b"what was sent is not compared") if "eth" in frames else None
    log.close()
    return str(session.path)


def test_the_hash_is_what_its_page_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", record(tmp_path, FRAMES), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["links"]
    assert found["line"]["sha256"] == hashlib.sha256(b"abcdef").hexdigest()
    framed = b"".join(len(data).to_bytes(8, "little") + data for data in (b"one", b"two"))
    assert found["eth"] == {"kind": "udp", "frames": 2, "bytes": 6, "sha256": hashlib.sha256(framed).hexdigest()}


@pytest.mark.parametrize(
    ("other", "results"),
    [
        (FRAMES, {"line": "EQUAL", "eth": "EQUAL"}),
        ({**FRAMES, "line": [b"a", b"bcde", b"f"]}, {"line": "EQUAL", "eth": "EQUAL"}),
        ({**FRAMES, "line": [b"abc", b"dex"]}, {"line": "DIFFERENT", "eth": "EQUAL"}),
        ({**FRAMES, "eth": [b"onet", b"wo"]}, {"line": "EQUAL", "eth": "DIFFERENT"}),
        ({**FRAMES, "eth": [b"two", b"one"]}, {"line": "EQUAL", "eth": "DIFFERENT"}),
        ({**FRAMES, "eth": [b"one"]}, {"line": "EQUAL", "eth": "DIFFERENT"}),
        ({"line": FRAMES["line"]}, {"line": "EQUAL", "eth": "not in the other session"}),
    ],
)
def test_each_link_has_its_result(
    other: Frames, results: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = main(["compare", record(tmp_path, FRAMES), record(tmp_path, other)])
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert lines.keys() == results.keys()
    for link, result in results.items():
        assert result in lines[link]
    assert code == (0 if set(results.values()) == {"EQUAL"} else 1)


def test_beside_what_differs_stand_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = record(tmp_path, FRAMES), record(tmp_path, {**FRAMES, "line": [b"abcde"]})
    assert main(["compare", first, second]) == 1
    line = capsys.readouterr().out.splitlines()[0]
    for data, frames in ((b"abcdef", 2), (b"abcde", 1)):
        assert hashlib.sha256(data).hexdigest()[:16] in line
        assert f"{frames} frames" in line


def test_single_links_are_compared_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = record(tmp_path, FRAMES), record(tmp_path, {"line": FRAMES["line"]})
    assert main(["compare", first, second, "--only", "line"]) == 0
    assert main(["compare", first, second, "--only", "eth"]) == 2
    assert "no link 'eth'; links: line" in capsys.readouterr().err

"""Limits of what a session can be: file numbers, JSON, TOML, and that what the recorder writes is within them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.config import parse_toml
from fti.errors import ConfigError, RecordingError
from fti.logger.packing.pack import pack
from fti.logger.reading.json_message import parse_json, using_message, whole_number
from fti.logger.reading.limits import LimitError
from fti.logger.reading.mcap_file import McapFile
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.logger.stream_writer import StreamWriter
from fti.logger.verify.verification import verify
from tests.logger.small_session import STARTED, make


@pytest.mark.parametrize("number", ["99999999999", "9" * 200])
@pytest.mark.parametrize("command", ["verify", "info"])
def test_a_file_with_a_large_number(
    command: str, number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = make(SessionFolder.create(tmp_path, "s", STARTED), frames=100)
    (first,) = folder.files("raw")
    first.rename(folder.path / f"x_{number}.mcap")
    assert main([command, str(folder.path)]) == (1 if command == "verify" else 0)
    printed = capsys.readouterr().out
    assert command == "info" or f"raw files 0-{int(number) - 1} are missing" in printed


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"[" * 65 + b"]" * 65, "nested deeper than 64"),
        (b'["]",' * 65 + b"1" + b"]" * 65, "nested deeper than 64"),
        (b"9" * 42, "a number of 42 digits"),
        (b" " * (4 * 2**20 + 1), "at most 4194304 are read"),
    ],
)
def test_json_beyond_a_limit(text: bytes, message: str) -> None:
    with pytest.raises(LimitError, match=message):
        parse_json(text)


@pytest.mark.parametrize("text", [b"\xff", b"", b"{", b"nothing"])
def test_json_that_is_no_text(text: bytes) -> None:
    with pytest.raises(ValueError):
        parse_json(text)


def test_half_of_a_surrogate_pair_is_a_question_mark() -> None:
    """The recorder writes one itself where the name of a file is not UTF-8."""
    text = b'{"a\\udcff": ["\\ud800 half", "\\ud83d\\udee9 whole"], "n": 1}'
    assert parse_json(text) == {"a?": ["? half", "\U0001f6e9 whole"], "n": 1}


@pytest.mark.parametrize(
    "value",
    [
        18_446_744_073_709_551_615,
        -(2**63),
        "\U0001f6e9 \ud83d\udee9".encode("utf-16", "surrogatepass").decode("utf-16"),
        [[[[1.5]]]],
        {"many": [[]] * 1000, "brackets in texts": '"[' * 600},
        {"a": None, "b": True},
    ],
)
def test_json_within_the_limits_is_what_it_was(value: object) -> None:
    assert parse_json(json.dumps(value).encode()) == value


@pytest.mark.parametrize("value", [2**63, -(2**63) - 1, 1.0, True, "1", None])
def test_what_is_no_whole_number_of_64_bits(value: object) -> None:
    with pytest.raises(ValueError, match="not a whole number of 64 bits"):
        whole_number(value)


def test_a_message_that_cannot_be_used_is_named() -> None:
    with (
        pytest.raises(RecordingError, match=r"/fti/gap: the message at 17 ns has no 'kind'"),
        using_message("/fti/gap", 17),
    ):
        raise KeyError("kind")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = " + "[" * 40 + "]" * 40, "nested deeper than 32"),
        ("a" + ".b" * 40 + " = 1", "a key has more than 32 parts"),
        ("a = 9223372036854775808", "a: the number does not fit into 64 bits"),
        ("b = [1, {c = " + "9" * 4000 + "}]", "b: the number does not fit into 64 bits"),
        ("a = " + "9" * 5000, "is not valid TOML"),
        ("#" * (4 * 2**20 + 1), "is longer than"),
    ],
)
def test_toml_beyond_a_limit(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^f.toml: {message}|{message}"):
        parse_toml(text, "f.toml")


def test_a_chunk_that_caught_up_after_a_stall_is_read_packed_and_unpacked(tmp_path: Path) -> None:
    """All that buffers held is one chunk: more messages and more bytes than a small file may claim."""
    path, count = tmp_path / "s_000.mcap", 600_000
    with_noise = [(k * 2_654_435_761 % 2**32).to_bytes(4, "little") for k in range(count)]
    writer = StreamWriter(path)
    channel = writer.add_channel("/raw/a", "x-fti-raw")
    for k, data in enumerate(with_noise):
        writer.write(channel, STARTED + k, data, k)
    writer.close()
    pack(path, lambda done: None)
    chunks = list(McapFile(path).chunks())
    assert [item.data for chunk in chunks for item in chunk] == with_noise
    assert max(map(len, chunks)) == 2**16
    assert verify(Recording.open(path)).findings == ["no ledger in these files: complete reception cannot be verified"]

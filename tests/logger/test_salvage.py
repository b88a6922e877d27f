from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.writer import CompressionType

from tests.logger.damaged import Original, Span, is_part, recovered, write_foreign, write_own
from tests.logger.reading import Found

#: Quick and full counts; full: ``--scale full``.
FLIPS, HOLES, STEP = 400, 150, 11
ZSTD, LZ4, NONE = CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE


@pytest.fixture(params=["own", "zstd", "lz4"])
def original(request: pytest.FixtureRequest, tmp_path: Path) -> Original:
    path = tmp_path / "whole.mcap"
    if request.param == "own":
        return Original(write_own(path))
    return Original(write_foreign(path, ZSTD if request.param == "zstd" else LZ4))


def check(original: Original, damaged: bytes, damage: Span, folder: Path) -> None:
    """Nothing invented, and all chunks that were not hit are there."""
    found, report = recovered(damaged, folder)
    found = [m for m in found if not m[0].startswith("/recovered/")]
    assert is_part(found, original.messages), damage
    must = original.must_hold(damage)
    assert is_part(must, found) or report.messages == len(must), damage
    assert not (report.summary and report.complete) or report.messages == len(original.messages), damage


def test_a_whole_file_is_copied_whole(original: Original, tmp_path: Path) -> None:
    found, report = recovered(original.data, tmp_path)
    assert found == original.messages
    assert report.complete and report.all_told and not report.damages and not report.unproved


def test_random_bit_flips(original: Original, tmp_path: Path, scale: int) -> None:
    random_flips = random.Random(7)
    count = FLIPS if scale == 1 else 10_000
    for _ in range(count // 3):
        at, bit = random_flips.randrange(len(original.data)), random_flips.randrange(8)
        damaged = bytearray(original.data)
        damaged[at] ^= 1 << bit
        check(original, bytes(damaged), (at, at + 1), tmp_path)


def holes(original: Original, count: int) -> Iterator[tuple[Span, bool]]:
    random_holes = random.Random(8)
    for n in range(count):
        size = random_holes.choice((1, 9, 60, 512, 1500))
        at = random_holes.randrange(len(original.data))
        yield (at, min(at + size, len(original.data))), n % 2 == 0


def test_random_holes(original: Original, tmp_path: Path, scale: int) -> None:
    """Zeroed, and cut out."""
    for (begin, end), zeroed in holes(original, HOLES if scale == 1 else 1000):
        filling = bytes(end - begin) if zeroed else b""
        check(original, original.data[:begin] + filling + original.data[end:], (begin, end), tmp_path)


def test_cut_off_at_every_byte(original: Original, tmp_path: Path, scale: int) -> None:
    for size in range(0, len(original.data), STEP if scale == 1 else 1):
        check(original, original.data[:size], (size, len(original.data)), tmp_path)


def test_a_killed_file_cut_off_at_every_byte_gives_its_whole_records(tmp_path: Path, scale: int) -> None:
    killed = write_own(tmp_path / "killed.mcap", finish=False)
    whole, _ = recovered(killed, tmp_path)
    messages: list[Found] = []
    for size in range(0, len(killed), STEP if scale == 1 else 1):
        found, report = recovered(killed[:size], tmp_path)
        assert found == whole[: len(found)]
        assert len(found) >= len(messages)
        messages = found
        assert report.chunks or report.unproved == len(found)

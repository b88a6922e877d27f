"""Limits of the user's processes: one sentence where nothing can work; files stay below the limit of their size."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fti.config import Config, Session
from fti.config.tables import UdpLink
from fti.errors import MissingError, StorageError
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.service.limits import MIB, adapt_to_limits, raise_open_files

CONFIG = Config(
    session=Session(name="s"), link=tuple(UdpLink(name=f"l{i}", kind="udp", bind="127.0.0.1:0") for i in range(2))
)


@contextmanager
def limited(what: int, soft: int) -> Iterator[None]:
    before = resource.getrlimit(what)
    resource.setrlimit(what, (soft, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(what, before)


def test_without_limits_nothing_changes() -> None:
    warnings: list[str] = []
    assert adapt_to_limits(CONFIG, warnings.append) is CONFIG
    assert warnings == []


def test_too_few_open_files_are_one_sentence() -> None:
    with (
        limited(resource.RLIMIT_NOFILE, 20),
        pytest.raises(MissingError, match=r"ulimit -n.* is 20; must be at least 72"),
    ):
        adapt_to_limits(CONFIG, print)


def test_as_many_open_files_as_are_allowed() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    with limited(resource.RLIMIT_NOFILE, 200):
        raise_open_files()
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (before[1], before[1])


def test_no_file_for_the_ring_is_one_sentence() -> None:
    with limited(resource.RLIMIT_FSIZE, 64 * 1024), pytest.raises(MissingError, match=r"ulimit -f\) is 65536 bytes"):
        adapt_to_limits(CONFIG, print)


@pytest.mark.parametrize(("limit_mb", "split_mb"), [(40, 24), (100, 84), (2048, 1024)])
def test_files_are_split_before_they_are_too_large(limit_mb: int, split_mb: int) -> None:
    warnings: list[str] = []
    with limited(resource.RLIMIT_FSIZE, limit_mb * MIB):
        assert adapt_to_limits(CONFIG, warnings.append).session.split_mb == split_mb
    assert len(warnings) == (split_mb != 1024)


def test_a_file_at_its_limit_is_a_fault_of_storage_and_the_next_file_takes_what_follows(tmp_path: Path) -> None:
    assert signal.getsignal(signal.SIGXFSZ) == signal.SIG_IGN
    folder = SessionFolder.create(tmp_path, "s", 10**18)
    first, second = (
        RawLog(folder, [RawTopic("a", "udp", {})], LogSettings(split_s=60, split_mb=100)) for _ in range(2)
    )
    with limited(resource.RLIMIT_FSIZE, 2**20), pytest.raises(StorageError, match="File too large"):
        for seq in range(10_000):
            first.write_frame("a", seq, 10**18 + seq, os.urandom(1000))
            first.flush()
    second.write_frame("a", 20_000, 10**18 + 20_000, b"x")
    second.close()
    first.close()
    assert 900 < sum(1 for _ in Recording.open(folder.path).frames()) < 1100

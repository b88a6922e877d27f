"""Permissions of files and folders of a session: those of the configuration, whatever the umask says."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.logger.file_mode import DEFAULT, set_file_mode
from fti.logger.storage_target import StorageTarget
from tests.cli.sessions import make_folder, record_raw


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    yield
    set_file_mode(DEFAULT)


def _mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("umask", [0o000, 0o077])
@pytest.mark.parametrize(
    ("mode", "of_folder"), [(None, 0o750), (0o600, 0o700), (0o644, 0o755), (0o660, 0o770), (0o664, 0o775)]
)
def test_files_and_folders_have_the_mode(tmp_path: Path, umask: int, mode: int | None, of_folder: int) -> None:
    if mode is not None:
        set_file_mode(mode)
    before = os.umask(umask)
    try:
        folder = make_folder(tmp_path)
        record_raw(folder, range(10)).close()
        StorageTarget.of(tmp_path / "other").prepare()
    finally:
        os.umask(before)
    (file,) = folder.files("raw")
    assert _mode(file) == (0o640 if mode is None else mode)
    assert _mode(folder.path) == _mode(tmp_path / "other") == of_folder

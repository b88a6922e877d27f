"""Real file systems for the tests: made, filled, frozen, broken and taken away; only root may."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

NEEDED = ("mount", "umount", "mkfs.ext4", "losetup", "fsfreeze")
PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
EXT4_MB = 24
#: From this exit code on, e2fsck could not do its work.
E2FSCK_FAILED = 4


def _run(*command: str | Path) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, timeout=120,
                          env={**os.environ, "PATH": PATH})  # fmt: skip
    assert done.returncode == 0, f"{command}: {done.stderr}"
    return done.stdout.strip()


def skip_unless_possible() -> None:
    """Skip with the reason when this machine cannot make mounts."""
    if os.geteuid() != 0:
        pytest.skip("only root can make mounts")
    if missing := [name for name in NEEDED if not shutil.which(name, path=PATH)]:
        pytest.skip(f"not installed: {', '.join(missing)}")


class Mount:
    """A file system of its own on a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()

    def fill(self) -> Path:
        """Take all the space that there is; returns the file that has it."""
        filler = self.folder / "filler"
        with contextlib.suppress(OSError), filler.open("wb", buffering=0) as file:
            for size in (2**16, 2**12, 1):
                with contextlib.suppress(OSError):
                    while file.write(bytes(size)):
                        pass
        return filler

    def unmount(self) -> None:
        """Take it away, also from who uses it."""
        _run("umount", "-l", self.folder)


class Tmpfs(Mount):
    """A file system in memory."""

    def __init__(self, folder: Path, size_mb: int) -> None:
        super().__init__(folder)
        _run("mount", "-t", "tmpfs", "-o", f"size={size_mb}m", "tmpfs", folder)


class Ext4(Mount):
    """A file system in a file, as on a stick."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._image = folder.with_suffix(".img")
        with self._image.open("wb") as image:
            image.truncate(EXT4_MB * 2**20)
        _run("mkfs.ext4", "-q", "-F", self._image)
        try:
            self._device = _run("losetup", "-f", "--show", self._image)
        except AssertionError as error:
            pytest.skip(f"loop devices do not work here: {error}")
        self.mount()

    def mount(self) -> None:
        """Put it (back) in its place."""
        _run("mount", "-o", "errors=remount-ro", self._device, self.folder)

    def freeze(self) -> None:
        """Whoever writes waits."""
        _run("fsfreeze", "-f", self.folder)

    def thaw(self) -> None:
        """Whoever writes goes on."""
        _run("fsfreeze", "-u", self.folder)

    def break_down(self) -> None:
        """An error, after which it is read-only until it is mounted again."""
        name = Path(self._device).name
        Path(f"/sys/fs/ext4/{name}/trigger_fs_error").write_text("1")

    def repair(self) -> bool:
        """What is done with a medium after an error, before it is mounted again; False while somebody holds it."""
        environment = {**os.environ, "PATH": PATH}
        done = subprocess.run(["e2fsck", "-p", "-f", self._device], env=environment, check=False, capture_output=True)
        return done.returncode < E2FSCK_FAILED

    def detach(self) -> None:
        """Give the device back."""
        subprocess.run(["losetup", "-d", self._device], env={**os.environ, "PATH": PATH}, check=False)


@contextlib.contextmanager
def mounted(*mounts: Mount) -> Iterator[None]:
    """Whatever happens, the mounts go."""
    try:
        yield
    finally:
        for mount in mounts:
            if isinstance(mount, Ext4):
                with contextlib.suppress(AssertionError):
                    mount.thaw()
            while os.path.ismount(mount.folder):
                mount.unmount()
            if isinstance(mount, Ext4):
                mount.detach()

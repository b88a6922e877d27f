#!/usr/bin/env python3
"""Build the source archive, and the wheel from nothing but it:  python packaging/build_wheel.py FOLDER

Both are built in copies, because setuptools writes beside its sources.  Needs setuptools; prints the two files.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: What the source archive is made of.
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "THIRD_PARTY.md", "fti", "configs")
STEP = "import sys; from setuptools import build_meta as build; print(getattr(build, sys.argv[1])(sys.argv[2]))"


def copy_sources(folder: Path) -> None:
    """Copy what is needed; links stay links."""
    folder.mkdir()
    for source in (ROOT / name for name in SOURCES):
        if source.is_dir():
            shutil.copytree(source, folder / source.name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder)


def build(step: str, sources: Path, folder: Path) -> Path:
    """Run one step of setuptools in ``sources``; returns the new file in ``folder``."""
    done = subprocess.run(
        [sys.executable, "-c", STEP, step, str(folder)], cwd=sources, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    return folder / done.stdout.split()[-1]


def main() -> None:
    """Build both."""
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        copy_sources(Path(name, "sources"))
        sdist = build("build_sdist", Path(name, "sources"), folder)
        shutil.unpack_archive(sdist, Path(name, "unpacked"))
        (unpacked,) = Path(name, "unpacked").iterdir()
        print(sdist, build("build_wheel", unpacked, folder), sep="\n")


if __name__ == "__main__":
    main()

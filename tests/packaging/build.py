"""Builds the source archive and the wheel from what the repository holds, and installs the wheel alone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.helpers import ROOT

#: What the source archive is made of.
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "fti", "configs")
BUILD = """
import sys
from setuptools import build_meta
print(getattr(build_meta, sys.argv[1])(sys.argv[2]))
"""


def build_sdist(folder: Path) -> Path:
    """The source archive, built in a copy: a build writes beside its sources."""
    copy = folder / "sources"
    for name in SOURCES:
        source, target = ROOT / name, copy / name
        if source.is_dir():
            shutil.copytree(source, target, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
    return _build("build_sdist", copy, folder)


def build_wheel(sdist: Path, folder: Path) -> Path:
    """The wheel, built from nothing but the source archive."""
    shutil.unpack_archive(sdist, folder / "unpacked")
    (unpacked,) = (folder / "unpacked").iterdir()
    return _build("build_wheel", unpacked, folder)


def _build(step: str, sources: Path, folder: Path) -> Path:
    run = subprocess.run(
        [sys.executable, "-c", BUILD, step, str(folder)], cwd=sources, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return folder / run.stdout.split()[-1]


def install(wheel: Path, python: str, environment: Path) -> None:
    """Install a wheel with its dependencies, and nothing else, into a new environment of an interpreter."""
    _check([python, "-m", "venv", "--without-pip", str(environment)])
    pip = [sys.executable, "-m", "pip", "--python", str(environment / "bin" / "python"), "--quiet", "install"]
    _check([*pip, "--disable-pip-version-check", "--root-user-action", "ignore", "--only-binary", ":all:", str(wheel)])


def _check(command: list[str]) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # it may name this folder
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"{' '.join(command)}:\n{run.stdout}{run.stderr}"

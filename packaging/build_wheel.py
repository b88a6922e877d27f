#!/usr/bin/env python3
"""Build the source archive, and the wheel from nothing but it:  python packaging/build_wheel.py FOLDER

Both are built in copies, because setuptools writes beside its sources.  They hold the manual pages and the completion
of the shells, which fti itself writes.  Needs setuptools and the dependencies of fti; prints the two files.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: What the source archive is made of.
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "THIRD_PARTY.md", "fti", "configs")
#: Where each shell looks for the completion of a command, below share (Debian's folders).
COMPLETIONS = {
    "bash": "bash-completion/completions/fti",
    "zsh": "zsh/vendor-completions/_fti",
    "fish": "fish/vendor_completions.d/fti.fish",
}
STEP = "import sys; from setuptools import build_meta as build; print(getattr(build, sys.argv[1])(sys.argv[2]))"


def copy_sources(folder: Path) -> None:
    """Copy what is needed; links stay links."""
    folder.mkdir()
    for source in (ROOT / name for name in SOURCES):
        if source.is_dir():
            shutil.copytree(source, folder / source.name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder)


def write_shared_files(share: Path) -> None:
    """Write manual pages and completions, as ``[tool.setuptools.data-files]`` names them."""
    run_fti("man", str(share / "man"))
    for shell, name in COMPLETIONS.items():
        file = share / name
        file.parent.mkdir(parents=True)
        file.write_text(run_fti(shell), encoding="utf-8")


def run_fti(*arguments: str) -> str:
    """The output of ``fti completion``."""
    command = (sys.executable, "-m", "fti.cli.main", "completion", *arguments)
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


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
        write_shared_files(Path(name, "sources", "share"))
        sdist = build("build_sdist", Path(name, "sources"), folder)
        shutil.unpack_archive(sdist, Path(name, "unpacked"))
        (unpacked,) = Path(name, "unpacked").iterdir()
        print(sdist, build("build_wheel", unpacked, folder), sep="\n")


if __name__ == "__main__":
    main()

"""Processes that skip the last garbage collection, or the destructors."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import atexit, gc
atexit.register(lambda: print(gc.get_freeze_count() > 1000))  # the first that is registered runs last
from fti.quick_exit import skip_last_collection
skip_last_collection()
print(gc.get_freeze_count())
"""


def test_objects_are_frozen_at_the_exit_and_not_before() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "True"]


@pytest.mark.parametrize(
    ("body", "code", "error"), [("return 3", 3, ""), ("raise OSError('full')", 1, "OSError: full\n")]
)
def test_a_process_ends_without_destructors(body: str, code: int, error: str) -> None:
    """What it has printed is printed; an error has its traceback."""
    script = f"""
import atexit
from fti.quick_exit import run_and_exit
atexit.register(print, "a destructor")
def main():
    print("written", end="")
    {body}
run_and_exit(main)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (code, "written")
    assert done.stderr.endswith(error)
    assert bool(done.stderr) == bool(error)

"""A process that skips the last garbage collection."""

from __future__ import annotations

import subprocess
import sys

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

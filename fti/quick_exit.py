"""Processes that end without the last garbage collection, or without destructors."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import traceback
from collections.abc import Callable
from typing import NoReturn


def skip_last_collection() -> None:
    """Let the interpreter end at once: it would search all objects for cycles, seconds with compiled kernels.

    What must be closed is closed before; the kernel frees the memory.
    """
    atexit.register(gc.freeze)


def run_and_exit(main: Callable[[], int]) -> NoReturn:
    """Run a program that closes its files itself, then end the process without destructors.

    A thread that still compiles a kernel would use objects of LLVM that the destructors of C++ have destroyed: LLVM
    prints failed assertions and aborts.
    """
    code = 1
    try:
        code = main()
    except Exception:  # noqa: BLE001  what the interpreter would print
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)

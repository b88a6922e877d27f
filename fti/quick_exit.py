"""A process that ends without the last garbage collection."""

from __future__ import annotations

import atexit
import gc


def skip_last_collection() -> None:
    """Let the interpreter end at once: it would search all objects for cycles, seconds with compiled kernels.

    What must be closed is closed before; the kernel frees the memory.
    """
    atexit.register(gc.freeze)

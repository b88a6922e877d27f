"""How the kernels of terrain and ranging are compiled."""

from __future__ import annotations

import functools
import hashlib
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def kernel(function: Kernel) -> Kernel:
    """Compile on the first call, keep the code on disk, release the interpreter lock; no reordering of sums."""
    compiled: Any = numba.njit(nogil=True, cache=True, error_model="numpy")(function)
    # numba looks only at the file of the function itself: a change in a kernel that it calls would go unnoticed.  It
    # looks at the time, which some file systems know to the second: read through one, all would be compiled anew
    stamp = [(path, _digest(path)) for path in sorted(_files(compiled))]
    compiled._cache._cache_file._source_stamp = stamp
    return cast(Kernel, compiled)


def is_cached(compiled: Any) -> bool:
    """Was a kernel compiled before on this machine?  Then its code is on disk."""
    return Path(compiled._cache._cache_file._index_path).exists()


@functools.cache
def _digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _files(compiled: Any) -> set[str]:
    """The source files of a kernel and of all that it calls."""
    function: types.FunctionType = compiled.py_func
    called = (function.__globals__.get(name) for name in function.__code__.co_names)
    return {function.__code__.co_filename}.union(*(_files(other) for other in called if hasattr(other, "py_func")))

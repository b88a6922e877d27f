"""Compilation of the kernels of terrain and ranging."""

from __future__ import annotations

import functools
import hashlib
import pickle
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import IndexDataCacheFile

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
#: What pickle raises for a damaged file, or for a class that another version of fti called otherwise.
UNREADABLE = (pickle.UnpicklingError, EOFError, AttributeError, ImportError, LookupError, TypeError, ValueError)


class KernelCacheFile(IndexDataCacheFile):
    """Compiled code on disk; an unreadable file counts as missing, so that the kernel is compiled again."""

    def load(self, key: Any) -> Any:
        """Compiled code of a signature; None where there is none."""
        try:
            return super().load(key)  # type: ignore[no-untyped-call]
        except UNREADABLE:
            return None

    def _load_index(self) -> Any:
        try:
            return super()._load_index()  # type: ignore[no-untyped-call]
        except UNREADABLE:
            return {}


def kernel(function: Kernel) -> Kernel:
    """Compile at the first call, cache on disk, release the interpreter lock; sums are not reordered."""
    compiled: Any = numba.njit(nogil=True, cache=True, error_model="numpy")(function)
    # numba checks only the file of the function itself: a change in a called kernel would not be detected.  It compares
    # the time, which some file systems round to seconds: then everything would be compiled again
    stamp = [(path, _digest(path)) for path in sorted(_files(compiled))]
    compiled._cache._cache_file._source_stamp = stamp
    compiled._cache._cache_file.__class__ = KernelCacheFile
    return cast(Kernel, compiled)


def is_cached(compiled: Any) -> bool:
    """Whether the compiled code of a kernel, as its source is now, is in the cache on disk."""
    return bool(compiled._cache._cache_file._load_index())


@functools.cache
def _digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _files(compiled: Any) -> set[str]:
    """The source files of a kernel and of all kernels that it calls."""
    function: types.FunctionType = compiled.py_func
    called = (function.__globals__.get(name) for name in function.__code__.co_names)
    return {function.__code__.co_filename}.union(*(_files(other) for other in called if hasattr(other, "py_func")))

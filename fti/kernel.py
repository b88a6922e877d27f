"""Compilation of numerical kernels."""

from __future__ import annotations

import functools
import hashlib
import pickle
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.caching import IndexDataCacheFile
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from fti.arrays import Array

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
#: What pickle raises for a damaged file, or for a class that another version of fti called otherwise.
UNREADABLE = (pickle.UnpicklingError, EOFError, AttributeError, ImportError, LookupError, TypeError, ValueError)

#: Plain functions that kernels can call.
_CALLABLE: set[Any] = set()


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
    """Compile at the first call, cache on disk, release the interpreter lock; sums are not reordered.

    A kernel may call other kernels and functions in plain floats, which are compiled with it.
    """
    return _compile(function, inlined=False)


def inlined_kernel(function: Kernel) -> Kernel:
    """A kernel that is compiled into each kernel that calls it: for small ones in the innermost loop."""
    return _compile(function, inlined=True)


def _compile(function: Kernel, *, inlined: bool) -> Kernel:
    for called in _called(function):
        _make_callable(called)
    compiled: Any = numba.njit(nogil=True, cache=True, error_model="numpy", forceinline=inlined)(function)
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
    """The source files of a kernel, and of all kernels and plain functions that it calls."""
    function: types.FunctionType = getattr(compiled, "py_func", compiled)
    return {function.__code__.co_filename}.union(*map(_files, _called(function)))


def _called(function: Any) -> list[Any]:
    """The kernels and plain functions of fti that a function calls."""
    named = (function.__globals__.get(name) for name in function.__code__.co_names)
    return [other for other in named if hasattr(other, "py_func") or _is_plain(other)]


def _is_plain(called: Any) -> bool:
    return isinstance(called, types.FunctionType) and called.__module__.startswith("fti.")


def _make_callable(function: Any) -> None:
    """Let kernels call a plain function, and those that it calls."""
    if _is_plain(function) and function not in _CALLABLE:
        _CALLABLE.add(function)
        register_jitable(function)
        for called in _called(function):
            _make_callable(called)


def flatten(*values: ArrayLike) -> tuple[tuple[int, ...], list[Array]]:
    """The common shape of some values, and each of them as a flat copy, for a loop that has one compiled form."""
    arrays = np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in values))
    return arrays[0].shape, [array.flatten() for array in arrays]

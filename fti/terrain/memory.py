"""Memory by address in compiled kernels: arrays, records on the stack, and prefetch."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic

from fti.arrays import Array
from fti.kernel import inlined_kernel

#: Alignment of a record on the stack: a line of the cache.
LINE_BYTES = 64

_BYTE_POINTER: Any = cgutils.voidptr_t
_INT32: Any = ir.IntType(32)


def _as_pointer(_typing: Any, _address: Any) -> Any:
    """Code generation of ``pointer(address)``."""

    def generate(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], _BYTE_POINTER)

    return numba.types.voidptr(numba.types.intp), generate


def stack_room(size: int) -> Any:
    """A function for kernels that returns a pointer to ``size`` bytes in the frame of the kernel that calls it.

    The kernel must not return the pointer.
    """

    def as_room(_typing: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, _args: Any) -> Any:
            room: Any = cgutils.alloca_once(  # type: ignore[no-untyped-call]
                builder, ir.ArrayType(ir.IntType(8), size)
            )
            room.align = LINE_BYTES
            return builder.bitcast(room, _BYTE_POINTER)

        return numba.types.voidptr(), generate

    return intrinsic(as_room)


def _as_prefetch(_typing: Any, _address: Any) -> Any:
    """Code generation of ``prefetch(address)``: for a read, into all caches."""

    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [_BYTE_POINTER, _INT32, _INT32, _INT32])
        function = builder.module.declare_intrinsic("llvm.prefetch", [_BYTE_POINTER], kind)
        builder.call(function, [builder.inttoptr(args[0], _BYTE_POINTER), _INT32(0), _INT32(3), _INT32(1)])
        return context.get_dummy_value()

    return numba.types.void(numba.types.intp), generate


pointer: Any = intrinsic(_as_pointer)
_prefetch: Any = intrinsic(_as_prefetch)
array_at: Any = numba.carray  # type: ignore[attr-defined]


@inlined_kernel
def doubles_at(address: int) -> Array:
    """The array of doubles at an address; its length is a dummy."""
    return array_at(pointer(address), (1,), np.float64)  # type: ignore[no-any-return]


@inlined_kernel
def prefetch(address: int) -> None:
    """Begin to load the line of the cache at an address, for a later step."""
    _prefetch(address)

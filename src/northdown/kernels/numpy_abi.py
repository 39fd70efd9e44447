"""Arrays of one live sample, read in place by a compiled function that Python calls directly.

numba's own way in (finding the type of each argument, wrapping each array) takes several times as long as a
filter's step. Here the function is handed the objects themselves and reads the fields of `PyArrayObject` where
NumPy's C interface fixes them. It reads fields only after seeing that the object's type is exactly ndarray, and
numbers only after seeing that they are three float64. `layout_holds` says whether the fields are where they ought
to be.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any, Final, NamedTuple

import numba
import numpy as np
from numba.core import types
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

from northdown.kernels.jit import inline
from northdown.kernels.quaternion import Vector

# Offsets in bytes. The head is a reference count and, last, the type.
_HEAD: Final = object.__basicsize__
_TYPE: Final = _HEAD - 8
_DATA: Final = _HEAD
_NDIM: Final = _HEAD + 8
_SHAPE: Final = _HEAD + 16
_STRIDES: Final = _HEAD + 24
_DTYPE: Final = _HEAD + 40
# In the dtype: letters of kind, type and byte order, a byte of flags, and the type's number in four bytes.
_KIND: Final = _HEAD + 8


@cache
def layout_holds() -> bool:
    """Whether this Python's arrays have their fields at the offsets used here."""
    array = np.zeros((2, 3))[:, 0]
    word, at = ctypes.c_int64.from_address, id(array)
    return (
        ctypes.sizeof(ctypes.c_void_p) == 8
        and np.ndarray.__basicsize__ >= _DTYPE + 8
        and word(at + _TYPE).value == id(np.ndarray)
        and word(at + _DTYPE).value == id(array.dtype)
        and ctypes.string_at(id(array.dtype) + _KIND, 3) == b"fd="
        and ctypes.c_int32.from_address(id(array.dtype) + _KIND + 4).value == array.dtype.num
        and word(at + _DATA).value == array.__array_interface__["data"][0]
        and ctypes.c_int32.from_address(at + _NDIM).value == 1
        and word(word(at + _SHAPE).value).value == 2
        and word(word(at + _STRIDES).value).value == 24
    )


class _Object(types.Opaque):
    """numba type of an argument that is passed as it is."""


# For the type checker these are anything: what is called is not what is written.
_intrinsic: Any = intrinsic
_carray: Any = getattr(numba, "carray")  # noqa: B009  (left out of numba's annotations)
_register_model: Any = register_model
_unbox: Any = unbox

OBJECT: Final = _Object("PyObject")
_register_model(_Object)(models.OpaqueModel)


@_unbox(_Object)
def _pass_on(typ: Any, obj: Any, c: Any) -> Any:
    return NativeValue(obj)  # type: ignore[no-untyped-call]


@_intrinsic
def _address(typingctx: Any, obj: Any) -> Any:
    """Address of an object."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ptrtoint(args[0], context.get_value_type(types.int64))

    return types.int64(obj), codegen


@_intrinsic
def _pointer(typingctx: Any, address: Any) -> Any:
    """Pointer to the float64 at an address."""
    kind = types.CPointer(types.float64)  # type: ignore[no-untyped-call]

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(kind))

    return kind(types.int64), codegen


def _loader(kind: Any) -> Any:
    @_intrinsic
    def load(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = builder.inttoptr(args[0], context.get_value_type(kind).as_pointer())
            return builder.load(pointer, align=1)

        return kind(types.int64), codegen

    return load


_int64: Final = _loader(types.int64)
_int32: Final = _loader(types.int32)
_float64: Final = _loader(types.float64)


@inline
def is_vector(like: Any, obj: Any) -> bool:
    """Whether an object is an ndarray of three numbers with the type of those of the ndarray `like`."""
    a, b = _address(like), _address(obj)
    if _int64(b + _TYPE) != _int64(a + _TYPE):
        return False
    same: bool = (
        _int64(_int64(b + _DTYPE) + _KIND) == _int64(_int64(a + _DTYPE) + _KIND)
        and _int32(b + _NDIM) == 1
        and _int64(_int64(b + _SHAPE)) == 3
    )
    return same


@inline
def vector(obj: Any) -> Vector:
    """The three numbers of an object for which `is_vector` holds, whatever its strides."""
    data, stride = _int64(_address(obj) + _DATA), _int64(_int64(_address(obj) + _STRIDES))
    return (_float64(data), _float64(data + stride), _float64(data + 2 * stride))


@inline
def doubles(obj: Any, n: int) -> Any:
    """The first n numbers of a contiguous ndarray of float64, as an array to numba."""
    return _carray(_pointer(_int64(_address(obj) + _DATA)), (n,))


@inline
def _is_vector_array(like: Any, array: Any) -> bool:
    return bool(array.size == 3)


@inline
def _vector_of_array(array: Any) -> Vector:
    return (array[0], array[1], array[2])


@inline
def _array_itself(array: Any, n: int) -> Any:
    return array


class Reading(NamedTuple):
    """A way for a compiled function to read its arrays: numba's type of them, and the functions above."""

    kind: Any
    is_vector: Any
    vector: Any
    doubles: Any


IN_PLACE: Final = Reading(OBJECT, is_vector, vector, doubles)
THROUGH_NUMBA: Final = Reading(numba.float64[::1], _is_vector_array, _vector_of_array, _array_itself)
"""For interpreters where `layout_holds` is false."""

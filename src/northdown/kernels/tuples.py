"""Between arrays and tuples in straight-line code.

numba's own `to_fixed_tuple`, and a loop that reads a tuple by its index, copy or search the tuple once per entry:
a filter of 100 numbers would spend more time on that than on its step.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.errors import RequireLiteralValue
from numba.extending import intrinsic

# Left untyped by numba.
_intrinsic: Any = intrinsic
_types: Any = types
_cgutils: Any = cgutils


@_intrinsic
def to_fixed_tuple(typingctx: Any, array: Any, length: Any) -> Any:
    """Tuple of the first `length` entries, a constant, of a contiguous array."""
    if not isinstance(length, _types.IntegerLiteral):
        raise RequireLiteralValue("length must be a constant")
    n = length.literal_value
    result = _types.UniTuple(array.dtype, n)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        entries = [builder.load(_cgutils.gep_inbounds(builder, data, i)) for i in range(n)]
        return context.make_tuple(builder, result, entries)

    return result(array, length), codegen


@_intrinsic
def put_tuple(typingctx: Any, array: Any, values: Any) -> Any:
    """Write a tuple of floats to the beginning of a contiguous array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        for i, value in enumerate(_cgutils.unpack_tuple(builder, args[1])):
            builder.store(value, _cgutils.gep_inbounds(builder, data, i))
        return context.get_dummy_value()

    return _types.void(array, values), codegen

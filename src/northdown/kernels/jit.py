"""How kernels are compiled, and how the result is kept between processes.

numba's own on-disk cache looks only at the file of the outermost function, so it would hand out stale code
after an edit to a helper, and it never hits for functions made in a closure. Here the key is a hash of every
source file that can reach a kernel, together with the name of the kernel.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile

F = TypeVar("F", bound=Callable[..., Any])

# Contraction to fused multiply-add and ignoring the sign of zero are safe here; the rest of fastmath may
# delete the NaN tests that mark missing samples.
_FLAGS: dict[str, Any] = {"fastmath": {"contract", "nsz"}, "error_model": "numpy"}


def inline(function: F) -> F:
    """Decorate a helper or a filter's step: LLVM always inlines it, so that a step is one piece of code."""
    return numba.njit(forceinline=True, **_FLAGS)(function)  # type: ignore[no-any-return]


@cache
def source_hash() -> str:
    """Hash of all sources from which kernels are built."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for folder in ("kernels", "estimators"):
        for path in sorted((package / folder).glob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


class _KernelCache(FunctionCache):
    """numba's function cache, keyed by kernel name and by the sources of all kernels."""

    def __init__(self, function: Callable[..., Any], name: str) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=self._cache_path,
            filename_base=f"{name}-{self._impl.filename_base}",
            source_stamp=source_hash(),
        )

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (sig, codegen.magic_tuple())


def compiled(function: Callable[..., Any], name: str, signature: str) -> Callable[..., Any]:
    """Compile a function for one signature and keep the machine code on disk under `name`.

    Arguments of other types raise TypeError instead of being compiled for. Where numba finds no writable folder
    for its cache, the function is compiled anew in each process.
    """
    dispatcher = numba.njit(**_FLAGS)(function)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    try:
        dispatcher._cache = _KernelCache(function, name)
    except (RuntimeError, OSError, AttributeError) as problem:
        warnings.warn(f"compiled kernels are not kept between runs: {problem}", RuntimeWarning, stacklevel=2)
    dispatcher.compile(signature)
    dispatcher.disable_compile()
    return dispatcher  # type: ignore[no-any-return]

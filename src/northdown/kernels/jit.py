"""How kernels are compiled, and how the result is kept between processes.

numba's own on-disk cache looks only at the file of the outermost function, so it would hand out stale code
after an edit to a helper, and it never hits for functions made in a closure. Here the key is a hash of every
source file that can reach a kernel, together with the name of the kernel.
"""

from __future__ import annotations

import functools
import hashlib
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.registry import cpu_target

# Some of the options used here are missing in its annotations.
_njit: Any = numba.njit

F = TypeVar("F", bound=Callable[..., Any])

# Contraction to fused multiply-add and ignoring the sign of zero are safe here; the rest of fastmath may
# delete the NaN tests that mark missing samples.
_FLAGS: Final[dict[str, Any]] = {"fastmath": {"contract", "nsz"}, "error_model": "numpy"}

_FOLDERS: Final = ("arrays", "estimators", "kernels")


class _Inlined:
    """A helper as compiled callers see it (`_numba_type_`, numba's own protocol) and as Python may call it.

    Wrappers for calls from Python take a third of the time to compile a kernel, and most helpers never need theirs.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function

    @functools.cached_property
    def _inlined(self) -> Any:
        # Made when first needed: where all kernels come from the disk, that is never.
        return _njit(forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_FLAGS)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        return self._inlined._numba_type_

    @functools.cached_property
    def _from_python(self) -> Callable[..., Any]:
        return _njit(**_FLAGS)(self.py_func)  # type: ignore[no-any-return]

    def __call__(self, *args: Any) -> Any:
        return self._from_python(*args)


def inline(function: F) -> F:
    """Decorate a helper or a filter's step: LLVM always inlines it, so that a step is one piece of code."""
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    return _Inlined(function)  # type: ignore[return-value]


def source_hash() -> str:
    """Hash of all sources from which kernels are built, as they are on disk now."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for folder in _FOLDERS:
        for path in sorted((package / folder).glob("*.py")):
            digest.update(f"{folder}/{path.name}".encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


# Taken before any estimator is imported. A later hash could belong to an edit that this process has not loaded.
_SOURCES: Final = source_hash()


class _KernelCache(FunctionCache):
    """numba's function cache, keyed by kernel name and by the sources of all kernels.

    One pair of files per kernel, Python and processor, written over when the sources change. The processor is in the
    name because machines of a cluster may share the folder.
    """

    def __init__(self, function: Callable[..., Any], name: str) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        machine = repr(cpu_target.target_context.codegen().magic_tuple())
        python = f"{sys.implementation.cache_tag}{getattr(sys, 'abiflags', '')}"
        self._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=self._cache_path,
            filename_base=f"{name}.{python}-{hashlib.sha256(machine.encode()).hexdigest()[:8]}",
            source_stamp=_SOURCES,
        )

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (sig, codegen.magic_tuple())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # a damaged file: unpickling one may raise anything
            self._rewrite(self.flush)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        if source_hash() == _SOURCES:
            self._rewrite(lambda: super(_KernelCache, self).save_overload(sig, data))  # type: ignore[no-untyped-call]

    def _rewrite(self, action: Callable[[], None]) -> None:
        try:
            action()
        except OSError as problem:
            _warn_not_kept(problem)


def _warn_not_kept(problem: Exception) -> None:
    warnings.warn(f"compiled kernels are not kept between runs: {problem}", RuntimeWarning, stacklevel=3)


def compiled(function: Callable[..., Any], name: str, signature: Any) -> Callable[..., Any]:
    """Compile a function for one signature and keep the machine code on disk under `name`.

    Arguments of other types raise TypeError instead of being compiled for. Where numba finds no writable folder
    for its cache, the function is compiled anew in each process.
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    dispatcher = _njit(**_FLAGS)(function)
    try:
        dispatcher._cache = _KernelCache(function, name)
    except (RuntimeError, OSError, AttributeError) as problem:
        _warn_not_kept(problem)
    dispatcher.compile(signature)
    dispatcher.disable_compile()
    return dispatcher  # type: ignore[no-any-return]

"""Compile mahony.c on the spot and call it."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

import northdown as nd

FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
_HERE = Path(__file__).resolve().parent


class NoCompilerError(Exception):
    """Why there is no C to compare with."""


def load() -> ctypes.CDLL:
    """Compile and load; `NoCompilerError` says why not."""
    compiler = next((c for c in (os.environ.get("CC"), "cc", "gcc", "clang") if c and shutil.which(c)), None)
    if compiler is None:
        raise NoCompilerError("no C compiler found: install gcc or clang, or set CC")
    build = _HERE / "_build"
    build.mkdir(exist_ok=True)
    library = build / "mahony.so"
    command = [compiler, *FLAGS, "-o", str(library), str(_HERE / "mahony.c"), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NoCompilerError(
            f"{compiler} failed: {done.stderr.strip().splitlines()[-1] if done.stderr else done.returncode}"
        )
    return ctypes.CDLL(str(library))


def runner(
    library: ctypes.CDLL, function: str, recording: nd.Recording, estimator: nd.Mahony
) -> Callable[[np.ndarray], np.ndarray]:
    """A call that fills an (N, 7) array with quaternions (body → NED) and biases, from northdown's first attitude."""
    call = getattr(library, function)
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    call.argtypes = [ctypes.c_void_p] * 7 + [ctypes.c_long]
    call.restype = None
    params = np.array([estimator.kp, estimator.ki])
    start = np.zeros(7)
    start[:4] = estimator.run(recording[:1], frame="NED").quat[0]
    inputs = [pointer.from_param(a) and a for a in (recording.time, recording.gyr, recording.acc, recording.mag)]
    addresses = [a.ctypes.data for a in inputs]

    def run(out: np.ndarray) -> np.ndarray:
        state = start.copy()
        call(params.ctypes.data, state.ctypes.data, *addresses, out.ctypes.data, len(out))
        return out

    return run

"""Seeds: each source of randomness has a stream of its own, named by what it is for."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from northdown.errors import InputError, expected

Seed: TypeAlias = "int | np.random.Generator"
"""A whole number, or a generator from which one is drawn."""


def check_seed(seed: Any) -> int:
    """Whole number of 0 or more; from a generator one is drawn, so that a second use of it gives another."""
    if isinstance(seed, np.random.Generator):
        return int(seed.integers(1 << 62))
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InputError(expected("a seed that is a whole number of 0 or more, or a numpy Generator", repr(seed)))
    return int(seed)


def generator(seed: Seed, *purpose: int) -> np.random.Generator:
    """Generator of the stream for one purpose, independent of those for all others.

    Parameters
    ----------
    seed : int or numpy.random.Generator
        What the user gave.
    purpose : int
        Numbers that name the stream, such as of the sensor and of its error.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(check_seed(seed), spawn_key=purpose)))

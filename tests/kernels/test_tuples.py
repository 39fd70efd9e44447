"""Arrays to tuples and back."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from northdown.kernels.tuples import put_tuple, to_fixed_tuple


@pytest.mark.parametrize("n", [1, 3, 150])
def test_round_trip(n):
    @numba.njit
    def back(source, target):
        values = to_fixed_tuple(source[2:], n)
        put_tuple(target[1:], values)
        return values

    source, target = np.arange(200.0), np.full(200, -1.0)
    assert back(source, target) == tuple(source[2 : n + 2])
    assert np.array_equal(target[1 : n + 1], source[2 : n + 2])
    assert (np.delete(target, np.arange(1, n + 1)) == -1.0).all()


def test_length_must_be_a_constant():
    @numba.njit
    def first(source, n):
        return to_fixed_tuple(source, n)

    with pytest.raises(numba.errors.TypingError, match="must be a constant"):
        first(np.arange(3.0), 2)

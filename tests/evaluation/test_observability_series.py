"""Taylor series: coefficients known in closed form, algebraic laws, derivatives by the complex part."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipj

from northdown.evaluation.observability_series import TINY, Series

ORDER = 5
TIME = np.array([-0.7, 0.0, 0.3, 2.0])
ROUNDING = 1e-13  # relative: some fifty operations on numbers of size one to ten


def clock(order: int = ORDER) -> Series:
    return Series.of_time(TIME, order)


def check(series: Series, *derivatives: np.ndarray) -> None:
    """Compare with the derivatives 0, 1, … at `TIME`."""
    assert series.order == len(derivatives) - 1
    for k, (c, d) in enumerate(zip(series.coefficients, derivatives, strict=True)):
        np.testing.assert_allclose(math.factorial(k) * c, d, rtol=ROUNDING, atol=ROUNDING)


def test_functions_in_closed_form():
    s, c, e = np.sin(3 * TIME), np.cos(3 * TIME), np.exp(0.5 * TIME)
    check(np.sin(3.0 * clock()), s, 3 * c, -9 * s, -27 * c, 81 * s, 243 * c)
    check(np.cos(clock() * 3.0), c, -3 * s, -9 * c, 27 * s, 81 * c, -243 * s)
    check(np.exp(clock() / 2.0), *(e * 0.5**k for k in range(ORDER + 1)))
    u = 5.0 + TIME
    check(np.sqrt(5.0 + clock(3)), u**0.5, 0.5 * u**-0.5, -0.25 * u**-1.5, 0.375 * u**-2.5)
    check(1.0 / (5.0 + clock(3)), 1 / u, -1 / u**2, 2 / u**3, -6 / u**4)
    t = np.tan(0.4 * TIME)
    check(np.tan(0.4 * clock(2)), t, 0.4 * (1 + t * t), 0.32 * t * (1 + t * t))
    check(np.square(clock(2)) - -clock(2), TIME**2 + TIME, 2 * TIME + 1, np.full(4, 2.0))


def test_elliptic_functions():
    m, a = 0.4, 1.7
    sn, cn, dn, _ = ellipj(a * TIME, m)
    found = ellipj(a * clock(2), m)
    check(found[0], sn, a * cn * dn, -a * a * sn * (dn**2 + m * cn**2))
    check(found[1], cn, -a * sn * dn, a * a * cn * (m * sn**2 - dn**2))
    check(found[2], dn, -a * m * sn * cn, a * a * m * dn * (sn**2 - cn**2))
    check(found[3].derivative(), a * dn, -a * a * m * sn * cn)


def test_arrays_and_constants():
    t = clock(2)
    both = np.stack([t, np.ones_like(t), TIME])
    assert both.shape == (3, 4)
    assert len(both) == 3
    check(both[0], TIME, np.ones(4), np.zeros(4))
    check(both[2], TIME, np.zeros(4), np.zeros(4))
    joined = np.concatenate([both, np.zeros((1, 4)), np.full_like(t, 7.0)[None]])
    check(joined[4], np.full(4, 7.0), np.zeros(4), np.zeros(4))
    # a column of constants times a series of times
    check((np.array([[2.0], [3.0]]) * t)[1], 3 * TIME, np.full(4, 3.0), np.zeros(4))
    check(np.zeros_like(t), np.zeros(4), np.zeros(4), np.zeros(4))
    check(Series.of_time(TIME, 0) + 1.0, TIME + 1.0)


def test_the_shorter_series_limits_the_result():
    assert (clock(4) * clock(2)).order == 2
    assert np.stack([clock(1), clock(3)]).order == 1


def test_unknown_functions_are_refused():
    for function in (np.floor, np.abs, np.arctan):
        with pytest.raises(TypeError):
            function(clock())
    with pytest.raises(TypeError):
        np.add.reduce(clock())
    with pytest.raises(TypeError):
        np.sum(clock())
    with pytest.raises(TypeError):
        np.sin(clock(), where=np.array([True, False, True, True]))


numbers = st.floats(-3.0, 3.0)
series = st.lists(numbers, min_size=5, max_size=5).map(lambda c: Series([np.array([x]) for x in c]))
away_from_zero = st.tuples(st.floats(0.5, 3.0), st.lists(numbers, min_size=4, max_size=4)).map(
    lambda c: Series([np.array([x]) for x in (c[0], *c[1])])
)


def assert_same(a: Series, b: Series) -> None:
    size = max(1.0, *(float(np.abs(c).max()) for x in (a, b) for c in x.coefficients))
    for p, q in zip(a.coefficients, b.coefficients, strict=True):
        np.testing.assert_allclose(p, q, atol=1e-9 * size, rtol=0)  # cancellation of up to some 1e4


@given(series, series, away_from_zero)
@settings(max_examples=30, deadline=None)
def test_laws(a, b, c):
    assert_same((a + b) * c, a * c + b * c)
    # quotients of series that grow are large, and their product cancels
    quotient = a / c
    scale = max(1.0, *(float(np.abs(x).max()) for x in quotient.coefficients))
    for p, q in zip((quotient * c).coefficients, a.coefficients, strict=True):
        np.testing.assert_allclose(p, q, atol=1e-12 * scale, rtol=0)
    assert_same(np.sin(a) * np.sin(a) + np.cos(a) * np.cos(a), Series.constant(np.ones(1), 4))
    assert_same(np.exp(a) * np.exp(-a), Series.constant(np.ones(1), 4))
    # Leibniz: (ab)′ = a′b + ab′
    assert_same((a * b).derivative(), a.derivative() * b + a * b.derivative())


@given(away_from_zero)
@settings(max_examples=30, deadline=None)
def test_root(c):
    root = np.sqrt(c)
    scale = max(1.0, *(float(np.abs(x).max()) for x in root.coefficients)) ** 2
    for p, q in zip((root * root).coefficients, c.coefficients, strict=True):
        np.testing.assert_allclose(p, q, atol=1e-13 * scale, rtol=0)


def test_imaginary_part_is_the_derivative():
    # of f(x, τ) = sin(x (1 + τ)) / √(x + τ) by x at x = 0.8, and of its derivative by τ there
    x = Series.constant(np.array([0.8 + 1j * TINY]), 1)
    t = Series.of_time(np.zeros(1), 1)
    f = np.sin(x * (1.0 + t)) / np.sqrt(x + t)
    s, c, v = math.sin(0.8), math.cos(0.8), 0.8
    by_x = c * v**-0.5 - 0.5 * s * v**-1.5
    # f_τ = x cos(x) x^-½ − ½ sin(x) x^-3/2, by x:
    by_x_tau = 0.5 * c * v**-0.5 - s * v**0.5 - 0.5 * c * v**-1.5 + 0.75 * s * v**-2.5
    assert f.coefficients[0].imag / TINY == pytest.approx(by_x, rel=1e-14)
    assert f.coefficients[1].imag / TINY == pytest.approx(by_x_tau, rel=1e-14)

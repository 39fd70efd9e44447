"""`Series`: truncated Taylor series in time, with NumPy's arithmetic.

A series holds the coefficients c₀ … c_K of c₀ + c₁ τ + … + c_K τᴷ, where τ is the time after the one at which it is
taken. Sums, products, quotients, sines and the like of series follow from recurrences on the coefficients, so the
derivatives of whatever is computed with them are exact but for rounding (A. Griewank, A. Walther, Evaluating
Derivatives, 2nd ed., SIAM 2008, chapter 13, doi:10.1137/1.9780898717761).

Coefficients may be complex. With an imaginary part of `TINY` on a state, the imaginary part of a result over `TINY`
is its derivative by that state: the square of `TINY` is lost in rounding, and nothing is subtracted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

TINY: Final = 1e-30
"""Imaginary part that stands for an infinitesimal."""


class Series(np.lib.mixins.NDArrayOperatorsMixin):
    """Array of truncated Taylor series.

    Parameters
    ----------
    coefficients : sequence of arrays
        c₀ … c_K, all of one shape, which is that of the series.
    """

    def __init__(self, coefficients: Sequence[Array]) -> None:
        self.coefficients = list(coefficients)

    @classmethod
    def constant(cls, value: Any, order: int) -> Series:
        """Value that does not change with time."""
        array = np.asarray(value)
        return cls([array, *(np.zeros_like(array) for _ in range(order))])

    @classmethod
    def of_time(cls, time: Array, order: int) -> Series:
        """Time itself, t + τ."""
        return cls([time, np.ones_like(time), *(np.zeros_like(time) for _ in range(order - 1))][: order + 1])

    @property
    def order(self) -> int:
        """Power of τ after which the series is cut off."""
        return len(self.coefficients) - 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of each coefficient."""
        return self.coefficients[0].shape

    def __len__(self) -> int:
        return len(self.coefficients[0])

    def __getitem__(self, key: Any) -> Series:
        return Series([c[key] for c in self.coefficients])

    def derivative(self) -> Series:
        """Derivative by time; of an order less."""
        return Series([k * c for k, c in enumerate(self.coefficients) if k > 0])

    def truncated(self, order: int) -> Series:
        """The same up to a lower order."""
        return Series(self.coefficients[: order + 1])

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        rule = _RULES.get(ufunc.__name__)
        if rule is None or method != "__call__" or options:
            return NotImplemented
        order = min(x.order for x in inputs if isinstance(x, Series))
        return rule(*(as_series(x, order) for x in inputs))

    def __array_function__(
        self, function: Callable[..., Any], types: Any, inputs: Sequence[Any], options: dict[str, Any]
    ) -> Any:
        if function in (np.stack, np.concatenate):
            parts, *more = inputs
            order = min(x.order for x in parts if isinstance(x, Series))
            rows = zip(*(as_series(x, order).coefficients for x in parts), strict=True)
            return Series([function(row, *more, **options) for row in rows])
        if function in (np.zeros_like, np.ones_like, np.full_like):
            like, *more = inputs
            return Series.constant(function(like.coefficients[0], *more, **options), like.order)
        return NotImplemented


def as_series(value: Any, order: int) -> Series:
    """A series cut to an order, or a constant as a series."""
    return value.truncated(order) if isinstance(value, Series) else Series.constant(value, order)


def _multiply(a: Series, b: Series) -> Series:
    p, q = a.coefficients, b.coefficients
    return Series([sum((p[i] * q[k - i] for i in range(1, k + 1)), p[0] * q[k]) for k in range(len(p))])


def _divide(a: Series, b: Series) -> Series:
    q = b.coefficients
    found: list[Array] = []
    for k, c in enumerate(a.coefficients):
        found.append((c - sum((q[i] * found[k - i] for i in range(1, k + 1)), 0.0 * q[0])) / q[0])
    return Series(found)


def _sqrt(a: Series) -> Series:
    found: list[Array] = [np.sqrt(a.coefficients[0])]
    for k in range(1, a.order + 1):
        inner = sum((found[i] * found[k - i] for i in range(1, k)), 0.0 * found[0])
        found.append((a.coefficients[k] - inner) / (2.0 * found[0]))
    return Series(found)


def _chain(inner: Series, slope: Sequence[Array], k: int) -> Array:
    """Coefficient k of f(inner), given coefficients 0 … k − 1 of f′(inner)."""
    u = inner.coefficients
    total: Array = sum((i * u[i] * slope[k - i] for i in range(2, k + 1)), u[1] * slope[k - 1])
    return total / k


def _exp(a: Series) -> Series:
    found = [np.exp(a.coefficients[0])]
    for k in range(1, a.order + 1):
        found.append(_chain(a, found, k))
    return Series(found)


def _sin_cos(a: Series) -> tuple[Series, Series]:
    sine, cosine = [np.sin(a.coefficients[0])], [np.cos(a.coefficients[0])]
    for k in range(1, a.order + 1):
        up, down = _chain(a, cosine, k), _chain(a, sine, k)
        sine.append(up)
        cosine.append(-down)
    return Series(sine), Series(cosine)


def _ellipj(a: Series, parameter: Series) -> tuple[Series, Series, Series, Series]:
    """Jacobi's sn, cn, dn and the amplitude, of a constant parameter m."""
    from scipy.special import ellipj

    m = parameter.coefficients[0]
    found = [Series([x]) for x in ellipj(a.coefficients[0], m)]
    for k in range(1, a.order + 1):
        sn, cn, dn, amplitude = found
        slopes = cn * dn, -(sn * dn), -m * (sn * cn), dn
        found = [
            Series([*f.coefficients, _chain(a, slope.coefficients, k)])
            for f, slope in zip((sn, cn, dn, amplitude), slopes, strict=True)
        ]
    return found[0], found[1], found[2], found[3]


_RULES: Final[dict[str, Callable[..., Any]]] = {
    "add": lambda a, b: Series([p + q for p, q in zip(a.coefficients, b.coefficients, strict=True)]),
    "subtract": lambda a, b: Series([p - q for p, q in zip(a.coefficients, b.coefficients, strict=True)]),
    "multiply": _multiply,
    "divide": _divide,
    "negative": lambda a: Series([-p for p in a.coefficients]),
    "square": lambda a: _multiply(a, a),
    "sqrt": _sqrt,
    "exp": _exp,
    "sin": lambda a: _sin_cos(a)[0],
    "cos": lambda a: _sin_cos(a)[1],
    "tan": lambda a: _divide(*_sin_cos(a)),
    "ellipj": _ellipj,
}

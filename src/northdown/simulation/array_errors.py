"""`ArrayErrors`: what the accelerometers of an array add to the truth, and where they really are."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_number
from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.simulation.imu_errors import TriadErrors, check_burst
from northdown.simulation.seeds import generator

_EACH = ("noise", "instability", "walk", "bias", "offset")


@dataclass(frozen=True, kw_only=True, eq=False)
class ArrayErrors:
    """Errors of the accelerometers of an array; by default none.

    Parameters
    ----------
    noise, instability, walk : float or (K,) array
        Coefficients N (m/s²/√Hz), B (m/s²) and K (m/s²/√s) of all, or of each; see `TriadErrors`.
    bias : float or (K,) array
        Standard deviation of the constant bias drawn at turn-on, m/s².
    offset : float or (K,) array
        Known constant added to all samples, m/s².
    scale : float
        Standard deviation of the scale factors' relative error.
    misplacement : float
        Standard deviation, along each axis, of the true positions about those of the geometry, m. The effect grows
        with the square of the rate and with angular acceleration.
    misalignment : float
        Standard deviation of the angles (rad) by which the true sensing directions lean to either side.
    resolution : float
        Step of quantisation, m/s²; 0 for none.
    limit : float
        Samples saturate at ± this, m/s².
    bandwidth : float
        −3 dB frequency of the low-pass filter through which truth and noise pass, Hz; infinite for none.
    order : {1, 2}
        Order of that filter.
    delay : float
        Pure delay between truth and sample, s.
    dropout : float
        Part of the rows in which the whole array is missing (NaN), 0 or more and less than 1.
    dropout_length : float
        Mean number of rows missing at a time, 1 or more.
    """

    noise: npt.ArrayLike = 0.0
    instability: npt.ArrayLike = 0.0
    walk: npt.ArrayLike = 0.0
    bias: npt.ArrayLike = 0.0
    offset: npt.ArrayLike = 0.0
    scale: float = 0.0
    misplacement: float = 0.0
    misalignment: float = 0.0
    resolution: float = 0.0
    limit: float = math.inf
    bandwidth: float = math.inf
    order: int = 1
    delay: float = 0.0
    dropout: float = 0.0
    dropout_length: float = 1.0

    def __post_init__(self) -> None:
        for name in _EACH:
            value = as_float_array(name, getattr(self, name))
            if value.ndim > 1 or not np.isfinite(value).all() or (name != "offset" and (value < 0.0).any()):
                what = f"a number of at least 0 for {name}, or one for each accelerometer"
                raise InputError(expected(what, f"{value.tolist()!s:.100}"))
            object.__setattr__(self, name, value)
        check_number("misplacement", self.misplacement, low=0.0, unit="m")
        check_number("misalignment", self.misalignment, low=0.0, high=1.0, unit="rad")
        check_burst("dropout", self.dropout, self.dropout_length)
        self._triad(np.zeros((len(_EACH), 3)))  # checks the rest

    @classmethod
    def of(cls, sensor: TriadErrors, *, misplacement: float = 0.0) -> ArrayErrors:
        """Errors of single-axis accelerometers that are each like the x axis of a three-axis one.

        Parameters
        ----------
        sensor : TriadErrors
            Such as ``LOW_COST.acc``; its own clock and its correlation times are left out.
        misplacement : float
            m.
        """
        if not isinstance(sensor, TriadErrors):
            raise InputError(expected("TriadErrors", type(sensor).__name__))
        shared = {f.name for f in fields(cls)} & {f.name for f in fields(TriadErrors)}
        values: dict[str, Any] = {name: getattr(sensor, name) for name in shared}
        values |= {name: float(np.asarray(values[name])[0]) for name in _EACH}
        return cls(misplacement=misplacement, **values)

    def triads(self, count: int) -> list[TriadErrors]:
        """The errors of `count` accelerometers in threes, the last filled up with sensors without errors.

        Raises
        ------
        InputError
            When there are numbers for another number of accelerometers.
        """
        rows = []
        for name in _EACH:
            value: FloatArray = np.asarray(getattr(self, name))
            if value.ndim == 1 and len(value) != count:
                raise InputError(expected(f"{name} of {count} accelerometers", f"{len(value)}"))
            rows.append(np.broadcast_to(value, count))
        threes = -(-count // 3)
        full = np.zeros((len(_EACH), 3 * threes))
        full[:, :count] = np.stack(rows)
        return [self._triad(full[:, 3 * j : 3 * j + 3]) for j in range(threes)]

    def _triad(self, each: FloatArray) -> TriadErrors:
        return TriadErrors(
            **dict(zip(_EACH, each, strict=True)),
            scale=self.scale,
            resolution=self.resolution,
            limit=self.limit,
            bandwidth=self.bandwidth,
            order=self.order,
            delay=self.delay,
        )

    def true_geometry(self, array: AccelerometerArray, seed: int, *purpose: int) -> AccelerometerArray:
        """Where the accelerometers really are and point, with errors drawn from a stream of random numbers."""
        rng = generator(seed, *purpose)
        shift = self.misplacement * rng.standard_normal((len(array), 3))
        # what is along a direction has no effect: only unit vectors count
        lean = self.misalignment * rng.standard_normal((len(array), 3))
        return AccelerometerArray(array.position + shift, array.direction + lean, array.names, array.name)

"""Noise with known coefficients, made in other ways than the library's own."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft


def make_noise(n, rate, rng, *, quantisation=0.0, white=0.0, bias_instability=0.0, random_walk=0.0):
    """Samples (n,) of a signal with the coefficients Q, N, B and K.

    Flicker noise is white noise under half a discrete integration, (1 − z⁻¹)^(−1/2), whose two-sided density
    1/(2 sin(πf/rate)) per rate is B²/(2πf) for low frequencies.
    """
    signal = white * np.sqrt(rate) * rng.normal(size=n)
    signal += random_walk / np.sqrt(rate) * np.cumsum(rng.normal(size=n))
    if quantisation:
        signal += quantisation * rate * np.diff(rng.normal(size=n + 1))
    if bias_instability:
        k = np.arange(1.0, n)
        response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
        length = next_fast_len(2 * n)
        flicker = irfft(rfft(response, length) * rfft(rng.normal(size=n), length), length)[:n]
        signal += bias_instability * flicker
    return signal

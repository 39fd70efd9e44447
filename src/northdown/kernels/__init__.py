"""Numerical kernels: numba functions on scalars, tuples and arrays. No classes, no input or output.

Vectors are tuples of three floats, quaternions tuples (w, x, y, z). Helpers that a filter's step calls are
compiled with :data:`northdown.kernels.jit.inline` so that the whole step becomes one straight piece of code.
"""

"""Errors that northdown raises.

Every message says what was expected, what was found, at which sample, and what to do about it. A mistake in
the caller's data or arguments always raises a subclass of :class:`NorthdownError`, so that one ``except``
clause (and the command line) can tell it from a defect in the library.
"""

from __future__ import annotations


class NorthdownError(Exception):
    """Base of every error that northdown raises on purpose."""


class InputError(NorthdownError, ValueError):
    """Data or an argument is not what the function can work with."""


class FormatError(InputError):
    """A file is not of the format it was taken for, or is damaged."""


class MissingDependencyError(NorthdownError, ImportError):
    """An optional package is needed for what was asked."""


def expected(what: str, got: str, *, at: int | None = None, do: str | None = None) -> str:
    """Build the standard message 'expected …, got …, at sample i: do …'.

    Parameters
    ----------
    what, got : str
        What was expected and what was found.
    at : int, optional
        Index of the first offending sample.
    do : str, optional
        What the user should do, as an imperative.
    """
    message = f"expected {what}, got {got}"
    if at is not None:
        message += f", at sample {at}"
    if do is not None:
        message += f"; {do}"
    return message

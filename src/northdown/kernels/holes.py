"""From when on a time without samples is more than a step."""

from __future__ import annotations

from typing import Final

LONGEST_HOLE: Final = 1.0
"""Longest time (s) without samples over which an attitude is carried on; after a longer one it is found anew."""

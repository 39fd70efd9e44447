"""What clipping looks like: the figures by which a whole recording and a live stream are judged alike."""

from __future__ import annotations

from typing import Final

LOWEST_RANGE: Final = 2.0
"""Lowest rate (rad/s) at which a gyroscope clips: they have a range of 125 °/s or more."""
LONGEST_SWING: Final = 1.0
"""A swing beyond the range lasts no longer than this (s); a turntable does."""
CORNER: Final = 3.0 * 0.04
"""Slope before a plateau times its length, as a part of its level, from which it was entered with a corner.

A smooth peak that spends L samples in its top 1 % comes and goes with slopes of 4 % / L of it for each sample.
"""

"""TUM trajectories: lines of ``timestamp tx ty tz qx qy qz qw``, quaternions from body to world.

Source: the format of the TUM RGB-D benchmark (J. Sturm et al., IROS 2012, doi:10.1109/IROS.2012.6385773). It has no
place for a frame; northdown writes it in a comment line, which other readers skip. Positions are written as zeros and
left out when read. Note that the scalar part is the last column.
"""

from __future__ import annotations

import io
from typing import BinaryIO

import numpy as np

from northdown.errors import InputError, expected
from northdown.io.csv import comments_meta, meta_comments
from northdown.io.layout import check_kind, orientation_from_columns, orientation_meta
from northdown.io.text import Text
from northdown.orientation import Orientation

_HEADER = "# timestamp tx ty tz qx qy qz qw\n"


def matches(text: Text) -> bool:
    """Whether a text is eight columns between blanks, without a header of its own."""
    return not text.separator and len(text.labels) == 8 and text.labels[1:4] in (("", "", ""), ("tx", "ty", "tz"))


def read_orientation(text: Text, frame: str | None, name: str | None) -> Orientation:
    """Read time and quaternion of a trajectory; see `northdown.io.read_orientation`."""
    meta = comments_meta(text.comments)
    check_kind(meta, "orientation", text.source.label)
    values = text.load([0, 4, 5, 6, 7])
    columns = {"time": values[0]} | {f"q{c}": values[i] for c, i in zip("xyzw", range(4, 8), strict=True)}
    return orientation_from_columns(columns, meta, frame, name or text.source.stem)


def write_orientation(orientation: Orientation, file: BinaryIO) -> None:
    """Write time and quaternion; covariance, bias and flags have no place in this format."""
    import pandas as pd

    if not len(orientation):
        raise InputError(expected("at least one sample to write", "none"))
    position = np.zeros((len(orientation), 3))
    rows = np.column_stack([orientation.time, position, orientation.quat[:, 1:], orientation.quat[:, 0]])
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    text.write(meta_comments(orientation_meta(orientation)) + _HEADER)
    pd.DataFrame(rows).to_csv(text, sep=" ", header=False, index=False, lineterminator="\n")
    text.flush()
    text.detach()

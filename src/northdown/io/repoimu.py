"""RepoIMU: T-stick and pendulum trials with a Vicon reference.

Their files are semicolon-separated, with a line of groups above a line of axes, in seconds, m/s² and rad/s, with a
field of unit size. That much any such file is read for; here is what only this data set needs: the reference's world
and body axes both differ from the sensor's by constant rotations.

Source: A. Szczęsna et al., Reference data set for accuracy evaluation of orientation estimation algorithms for
inertial motion capture systems, ICCVG 2016, doi:10.1007/978-3-319-46418-3_45.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from northdown.io.assemble import Options
from northdown.recording import Recording

_HEADER = ("Time (s)", "Vicon Orientation W")


def matches(labels: Sequence[str]) -> bool:
    """Whether a header is RepoIMU's."""
    return tuple(labels[:2]) == _HEADER


def adjust(recording: Recording, options: Options) -> Recording:
    """State what the data set's reference is; its vertical axis points up, so results are in ENU unless asked."""
    frame = recording.frame if options.frame else "ENU"
    reference = recording.reference
    if reference is not None:
        reference = replace(reference, frame=frame, name="Vicon")
    return replace(recording, reference=reference, frame=frame, reference_offset="rotations")

"""Constant rotations between an estimate and the truth.

An optical system rarely shares its axes with the sensor. Its world frame may differ in heading, or altogether, and
its body frame by how the markers were glued on:

    mat_ref = L · mat_est · R        L: navigation frame (left), R: body frame (right)

The rotations are fitted to the estimate that is then judged, so errors after alignment are lower bounds of the true
ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
import numpy.typing as npt

from northdown._validation import check_choice
from northdown.checks import Finding, Findings
from northdown.errors import InputError, expected
from northdown.evaluation import _rotations
from northdown.evaluation.matching import Truth, match
from northdown.frames import Frame
from northdown.orientation import Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

AlignmentKind = Literal["none", "heading", "rotations"]
_KINDS: Final = ("none", "heading", "rotations")

# Neighbouring samples say much the same, so that more of them cost time and add nothing.
_MOST_SAMPLES = 20_000
# Of `Alignment.richness`: 1e-4 is a spread of about 0.6° about the least used axes, no more than the errors
# themselves, so that nothing could be told from it.
_NOT_RICH = 1e-4
# Beyond this standard deviation the alignment may take out as much as the errors that are to be judged.
_DOUBTFUL = math.radians(1.0)


@dataclass(frozen=True, eq=False)
class Alignment:
    """Constant rotations with truth = left · estimate · right.

    Parameters
    ----------
    kind : {"none", "heading", "rotations"}
        What was looked for.
    frame : {"NED", "ENU", "NWU"}
        Frame of the estimate; `left` is in its axes.
    left, right : scipy.spatial.transform.Rotation
        Rotation of the navigation frame and of the body frame.
    residual : float
        Root mean square of the total error that is left, rad, over all samples used.
    inliers : float
        Share of these samples, 0 to 1, whose error is no longer than five robust standard deviations of one of its
        components.
    richness : float
        How well the motion determines both rotations, 0 (it does not: all rotation was about one axis) to 1. It is
        the smallest eigenvalue of I − M̄ᵀM̄, M̄ the mean rotation matrix: for small rotations the variance (rad²) of
        the rotation about the two least used axes. NaN unless kind is ``"rotations"``.
    sigma : float
        Standard deviation, rad, of the worst determined direction of `left` or `right`, from how far ten parts of the
        data pull apart; errors that are alike in all parts do not show in it. NaN unless kind is ``"rotations"``.
    findings : Findings
        What to know before trusting it.
    """

    kind: AlignmentKind
    frame: Frame
    left: Rotation
    right: Rotation
    residual: float
    inliers: float = 1.0
    richness: float = math.nan
    sigma: float = math.nan
    findings: Findings = field(default_factory=Findings)

    def __repr__(self) -> str:
        left, right = (math.degrees(float(r.magnitude())) for r in (self.left, self.right))
        return (
            f"<Alignment {self.kind}: left turn {left:.2f}°, right turn {right:.2f}°, "
            f"residual {math.degrees(self.residual):.3f}°>"
        )

    def apply(self, orientation: Orientation) -> Orientation:
        """Bring an estimate to the axes of the truth: left · orientation · right.

        The result is labelled with the orientation's own frame, although its axes are now those of the truth.
        """
        return self._turn(orientation, self.left, self.right)

    def apply_inverse(self, truth: Orientation) -> Orientation:
        """Bring the truth to the axes of the estimate, whose vertical is the real one: left⁻¹ · truth · right⁻¹."""
        return self._turn(truth, self.left.inv(), self.right.inv())

    def _turn(self, orientation: Orientation, left: Rotation, right: Rotation) -> Orientation:
        return orientation.to_frame(self.frame).turned(left, right).to_frame(orientation.frame)


def align(
    estimate: Orientation,
    truth: Truth,
    kind: AlignmentKind,
    *,
    mask: npt.ArrayLike | None = None,
    max_gap: float | None = None,
) -> Alignment:
    """Find the constant rotations between an estimate and the truth.

    Parameters
    ----------
    estimate : Orientation
        Estimated orientation, N samples.
    truth : Orientation or Recording
        True orientation, or a recording that carries it; samples where its `movement` is false are left out.
    kind : {"none", "heading", "rotations"}
        ``"none"``: identities. ``"heading"``: one rotation about the vertical. ``"rotations"``: a rotation of the
        navigation frame and one of the body frame.
    mask : (N,) array of bool, optional
        Samples of the estimate to use.
    max_gap : float, optional
        Longest gap (s) of the truth to interpolate across; see `match`.

    Returns
    -------
    Alignment

    Raises
    ------
    InputError
        When the samples do not determine the rotations: too little motion, or rotation about one axis only.

    Notes
    -----
    ``"heading"`` is the closed-form minimum of Σ‖mat_ref − L mat_est‖² over rotations L about the vertical.

    ``"rotations"`` is the problem A X = Y B of hand–eye calibration. Relative rotations of both trajectories over
    many lags have rotation vectors that differ by R alone: R is the best rotation between two sets of vectors (F. C.
    Park, B. J. Martin, IEEE Trans. Robotics and Automation 10(5), 1994, doi:10.1109/70.326576); L is then a mean.
    Gauss–Newton steps on the total error, weighted by Cauchy's loss, refine both, so that a part that drifts or
    is clipped has little say, as long as it is the smaller part.
    """
    check_choice("kind", kind, _KINDS)
    matched = match(estimate, truth, mask=mask, max_gap=max_gap)
    return fit(estimate.rotation[matched.index], matched.truth.rotation, kind, estimate.frame)


def choose_kind(truth: Truth, alignment: AlignmentKind | Alignment | None) -> AlignmentKind | Alignment:
    """What to align: as asked, else as the recording says."""
    if alignment is None:
        return truth.reference_offset if isinstance(truth, Recording) else "none"
    if not isinstance(alignment, Alignment):
        check_choice("alignment", alignment, _KINDS)
    return alignment


def fit(estimate: Rotation, truth: Rotation, kind: AlignmentKind, frame: Frame) -> Alignment:
    """Alignment of rotations of equal length, both body → `frame`; see `align`."""
    from scipy.spatial.transform import Rotation

    left, right = Rotation.identity(), Rotation.identity()
    richness, sigma, inliers = math.nan, math.nan, 1.0
    findings: list[Finding] = []
    if kind == "heading":
        left = Rotation.from_rotvec([0.0, 0.0, _rotations.heading_offset(estimate, truth)])
    elif kind == "rotations":
        left, right, richness, sigma, inliers = _fit_both(estimate, truth)
    error = (left * estimate * right * truth.inv()).magnitude()
    residual = float(np.sqrt(np.mean(np.square(error))))
    if kind != "none":
        text = "the alignment was fitted to the estimate: errors are lower bounds"
        findings.append(Finding("alignment-fitted", "note", text))
    if sigma > _DOUBTFUL:
        known, spread = math.degrees(sigma), math.degrees(math.sqrt(richness))
        text = (
            f"the alignment is known to {known:.1f}° (1 sigma) only: rotation about the least used axes has a spread "
            f"of {spread:.1f}°; use a part with more of it"
        )
        findings.append(Finding("alignment-weak", "warning", text))
    if inliers < 0.8:
        text = (
            f"{100.0 * (1.0 - inliers):.0f} % of the samples disagree with the alignment; look for drift or clipping"
        )
        findings.append(Finding("alignment-outliers", "warning", text))
    findings.sort(key=lambda f: ("error", "warning", "note").index(f.severity))
    return Alignment(kind, frame, left, right, residual, inliers, richness, sigma, Findings(findings))


def _fit_both(estimate: Rotation, truth: Rotation) -> tuple[Rotation, Rotation, float, float, float]:
    """Left, right, richness, sigma and share of inliers; an error when the motion does not determine them."""
    estimate, truth = _rotations.thin(estimate, _MOST_SAMPLES), _rotations.thin(truth, _MOST_SAMPLES)
    richness = min(_rotations.richness(truth), _rotations.richness(estimate))
    start = _rotations.body_offset(estimate, truth) if richness >= _NOT_RICH else None
    if start is None:
        raise InputError(
            expected(
                "rotation about at least two axes, to find the alignment",
                f"a spread of {math.degrees(math.sqrt(max(richness, 0.0))):.2f}° about the least used axes",
                do="use a longer or livelier part, or alignment 'heading'",
            )
        )
    left = (truth * (estimate * start).inv()).mean()
    left, right, sigma, inliers = _rotations.refine(estimate, truth, left, start)
    return left, right, richness, sigma, inliers

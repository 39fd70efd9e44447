"""An analysis of an array in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from northdown.arrays.analysis import ArrayAnalysis


def summary_rows(analysis: ArrayAnalysis) -> list[tuple[str, str]]:
    """Labelled lines; a line with an empty label goes on with the one before."""
    array = analysis.array
    x, y, z = analysis.angular_noise
    fx, fy, fz = analysis.force_noise
    product = analysis.angular_dilution * analysis.length
    rows = [
        ("Array", f"{array.name or 'unnamed'}, {len(array)} accelerometers: {', '.join(array.names)}"),
        ("Size", f"{1e3 * analysis.length:.4g} mm, root mean square distance from their middle"),
        ("Condition", f"{analysis.condition:.3g} (1 is best; angular part scaled by that size)"),
        ("Noise, angular", f"x {x:.3g}, y {y:.3g}, z {z:.3g}, total {analysis.angular_dilution:.3g} rad/s² per m/s²"),
        ("", f"total {product:.3g} divided by the size: an array twice as large has half of it"),
        ("Noise, force", f"x {fx:.3g}, y {fy:.3g}, z {fz:.3g}, total {analysis.force_dilution:.3g} m/s² per m/s²"),
    ]
    leaks = analysis.leaks() or ["none: the products of rates need no correction"]
    rows += [("Products left in" if k == 0 else "", text) for k, text in enumerate(leaks)]
    rows.append(("Redundancy", analysis.redundancy()))
    return rows


def summarise(analysis: ArrayAnalysis) -> str:
    """The lines of `summary_rows` as text."""
    rows = summary_rows(analysis)
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:<{width}}  {text}" for label, text in rows)

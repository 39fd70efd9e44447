"""The picture of an array, and an array's channels among the sensors."""

from __future__ import annotations

import numpy as np
import pytest

from northdown import plots
from northdown.arrays import GEOMETRIES, coplanar7, cube9, geometry, tetrahedron12, triads
from northdown.errors import InputError
from northdown.simulation import rest, simulate_array


def arrows(ax):
    return [t for t in ax.texts if not t.get_text()]


def test_flat_one_from_above():
    figure = plots.array(coplanar7(0.0175))
    (ax,) = figure.axes
    # A1, A2, A3x, A3y in the plane; the rings of A4 to A6 are of 9 points
    assert len(arrows(ax)) == 4
    rings = [line for line in ax.lines if line.get_marker() == "o" and line.get_markersize() == 9.0]
    assert len(rings) == 3
    assert {t.get_text() for t in ax.texts} == {"", *coplanar7().names}
    first = arrows(ax)[0]
    # A1 senses along +x; positions in mm
    np.testing.assert_allclose(first.xyann, 17.5 * np.array([np.cos(np.deg2rad(80)), np.sin(np.deg2rad(80))]))
    assert first.xy[0] > first.xyann[0]
    assert first.xy[1] == pytest.approx(first.xyann[1])


def test_others_from_three_sides():
    figure = plots.array(tetrahedron12(0.05))
    assert [ax.get_xlabel() + ax.get_ylabel() for ax in figure.axes] == [
        "x (mm)y (mm)",
        "x (mm)z (mm)",
        "y (mm)z (mm)",
    ]
    for ax, mark in zip(figure.axes, ("o", "x", "o"), strict=True):
        # from above and from +x an axis points at the viewer; the view with z up and x to the right looks along +y
        ends = [line for line in ax.lines if line.get_marker() != "None" and line.get_markersize() in (3.5, 6.0)]
        assert {line.get_marker() for line in ends} == {mark}
        assert {t.get_text() for t in ax.texts} == {"", "t1xyz", "t2xyz", "t3xyz", "t4xyz"}


@pytest.mark.parametrize("name", [*GEOMETRIES, "ring8"])
def test_every_geometry_can_be_drawn_and_saved(name, tmp_path):
    plots.save(plots.array(geometry(name)), tmp_path / "a.svg")
    assert (tmp_path / "a.svg").stat().st_size > 1000


def test_degenerate_and_wrong():
    plots.array(triads([[0, 0, 0]]))
    plots.array(cube9(1.0).without(0))
    with pytest.raises(InputError, match="an AccelerometerArray"):
        plots.array("coplanar7")


def test_channels_among_the_sensors(tmp_path):
    recording = simulate_array(rest(2.0), tetrahedron12(), mag=None)
    figure = plots.sensors(recording)
    assert [ax.get_ylabel() for ax in figure.axes] == ["array\n(m/s²)"]
    assert len(figure.axes[0].lines) == 12
    plots.save(figure, tmp_path / "a.png")

"""Figures: what is drawn is what was measured, and nothing is hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown import plots
from northdown.errors import InputError
from northdown.evaluation import ClockOffset, attitude_error
from northdown.orientation import Orientation
from northdown.plots import _canvas, _lines
from northdown.recording import Recording

pytest.importorskip("matplotlib")

from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

N = 3000
TIME = np.arange(N) * 0.01


def motion(frame: str = "NED", name: str = "walk") -> Orientation:
    """Turns on and on in yaw, with some roll and pitch."""
    angles = np.column_stack([0.6 * TIME, 0.5 * np.sin(TIME), 0.8 * np.sin(0.7 * TIME)])
    return Orientation.from_rotation(TIME, Rotation.from_euler("ZYX", angles), frame, name=name)


def estimate(**fields: object) -> Orientation:
    turn = Rotation.from_rotvec(np.outer(np.sin(TIME), [0.01, 0.02, 0.05]))
    return replace(motion(), quat=np.roll((turn * motion().rotation).as_quat(), 1, axis=-1), name="filter", **fields)


def sensed(**fields: object) -> Recording:
    rng = np.random.default_rng(1)
    gyr, acc, mag = rng.normal(size=(3, N, 3))
    values = {
        "gyr": gyr,
        "acc": acc + np.array([0, 0, 9.81]),
        "mag": mag + np.array([20, 0, 40]),
        "name": "walk",
    } | fields
    return Recording(TIME, **values)  # type: ignore[arg-type]


def drawn(figure: Figure) -> Figure:
    figure.canvas.draw()
    return figure


def movement() -> np.ndarray:
    return (TIME > 5.0) & (TIME < 25.0)


def covariance() -> np.ndarray:
    return np.tile(np.diag([1e-4, 1e-4, 1e-3]), (N, 1, 1))


FIGURES = {
    "euler": lambda: plots.euler([estimate(covariance=covariance()), motion(name="")], sensed(reference=motion())),
    "euler without reference": lambda: plots.euler(estimate(), convention="rfu", degrees=False),
    "euler, one sample": lambda: plots.euler(estimate()[7:8], motion()),
    "quaternion": lambda: plots.quaternion([estimate(), motion("ENU")], motion()),
    "quaternion, one sample": lambda: plots.quaternion(estimate()[:1]),
    "sensors": lambda: plots.sensors(sensed(movement=movement())),
    "sensors, no field": lambda: plots.sensors(sensed(mag=np.full((N, 3), np.nan))),
    "sensors, gyroscope only": lambda: plots.sensors(sensed(acc=None, mag=None)),
    "sensors, one sample": lambda: plots.sensors(sensed()[:1]),
    "errors": lambda: plots.errors([attitude_error(estimate(), motion())] * 6),
}


@pytest.mark.parametrize("what", FIGURES)
def test_figures_are_legible_and_hide_nothing(what: str) -> None:
    figure = drawn(FIGURES[what]())
    width, height = figure.get_size_inches() * 2.54
    assert width <= 21.0  # A4
    assert height <= 29.7
    for text in figure.findobj(lambda artist: isinstance(artist, Text) and bool(artist.get_text())):
        assert text.get_fontsize() >= 8.0
    (legend,) = figure.legends
    box = legend.get_window_extent()
    whole = figure.bbox
    assert whole.x0 <= box.x0 < box.x1 <= whole.x1
    for ax in figure.axes:
        assert not box.overlaps(ax.get_window_extent())
        assert any(unit in ax.get_ylabel() for unit in ("(°)", "(rad)", "(–)", "(°/s)", "(m/s²)", "(µT)"))
        assert ax.get_ylabel()
        for line in ax.lines:
            x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
            shown = (x >= ax.get_xlim()[0]) & (x <= ax.get_xlim()[1]) & np.isfinite(y)
            assert (y[shown] <= ax.get_ylim()[1]).all()
            assert (y[shown] >= ax.get_ylim()[0]).all()
    assert "(s)" in figure.axes[-1].get_xlabel()
    assert figure.canvas.manager is None  # pyplot knows nothing of it


def labels(figure: Figure) -> list[str]:
    return [t.get_text() for t in figure.legends[0].get_texts()]


def test_error_panels_show_the_errors() -> None:
    error = attitude_error(estimate(), motion())
    figure = plots.errors(error)
    for ax, value in zip(figure.axes, (error.total, error.heading_signed, error.inclination), strict=True):
        np.testing.assert_allclose(ax.lines[0].get_ydata(), np.rad2deg(value), atol=1e-12)
        np.testing.assert_allclose(ax.lines[0].get_xdata(), error.time)
    assert labels(figure) == [f"filter: RMSE {error.rmse().total_deg:.2f}°"]
    assert "clocks" not in figure.legends[0].get_title().get_text()


def test_error_title_says_that_clocks_were_aligned() -> None:
    error = attitude_error(estimate(), motion(), clock=ClockOffset(0.002, 1e-4, 100))
    assert plots.errors(error).legends[0].get_title().get_text().endswith(", clocks aligned")


def test_angles_are_those_of_the_orientation() -> None:
    figure = plots.euler(motion("ENU"))
    angles = motion("ENU").as_euler(degrees=True)
    for i, ax in enumerate(figure.axes):
        x, y = (np.asarray(v) for v in ax.lines[0].get_data())
        at_samples = np.isin(x, TIME) & np.isfinite(y)
        np.testing.assert_allclose(y[at_samples], angles[:, i], atol=1e-9)
    assert [ax.get_ylabel() for ax in figure.axes] == ["roll (°)", "pitch (°)", "yaw (°)"]
    radians = plots.euler(motion("ENU"), degrees=False)
    np.testing.assert_allclose(radians.axes[1].lines[0].get_ydata(), np.deg2rad(angles[:, 1]), atol=1e-12)


def test_a_single_sample_is_seen() -> None:
    figure = plots.euler(motion()[7:8])
    assert [line.get_marker() for line in figure.axes[2].lines] == ["None", "."]
    assert [line.get_marker() for line in plots.euler(motion()).axes[2].lines] == ["None"]


def test_all_estimates_are_shown_in_one_frame() -> None:
    figure = plots.euler([motion(), motion().to_frame("ENU")])
    for ax in figure.axes:
        np.testing.assert_allclose(ax.lines[0].get_ydata(), ax.lines[1].get_ydata(), atol=1e-6)
    assert figure.legends[0].get_title().get_text().endswith("body → NED")
    assert labels(figure) == ["walk (1)", "walk (2)"]


def test_a_reference_with_axes_of_its_own_is_aligned() -> None:
    truth = motion().turned(Rotation.from_rotvec([0.1, 0.2, 2.0]), Rotation.from_rotvec([0.3, 0.0, 1.0]))
    recording = sensed(reference=truth, reference_offset="rotations")
    figure = plots.euler(motion(), recording)
    np.testing.assert_allclose(figure.axes[1].lines[1].get_ydata(), figure.axes[1].lines[0].get_ydata(), atol=1e-6)
    assert "RMSE 0.00°" in labels(figure)[0]
    figure = plots.quaternion(motion(), recording)
    for ax in figure.axes:
        np.testing.assert_allclose(ax.lines[1].get_ydata(), ax.lines[0].get_ydata(), atol=1e-8)


def test_what_does_not_count_is_shaded_and_not_in_the_rmse() -> None:
    turn = Rotation.from_rotvec(np.outer(~movement(), [0.0, 0.0, 1.0]))
    wrong = replace(motion(), quat=np.roll((turn * motion().rotation).as_quat(), 1, axis=-1))
    figure = plots.euler(wrong, sensed(reference=motion(), movement=movement()))
    assert "RMSE 0.00°" in labels(figure)[0]
    assert "not counted" in labels(figure)
    # the error is drawn all the same
    assert np.nanmax(np.asarray(figure.axes[4].lines[0].get_ydata())) == pytest.approx(np.rad2deg(1.0))
    vertices = figure.axes[0].collections[0].get_paths()
    first = vertices[0].get_extents()
    assert (first.x0, first.x1) == pytest.approx((0.0, 5.01))


def test_three_sigma_bands() -> None:
    figure = plots.euler(estimate(covariance=covariance()), motion())
    assert "3 sigma" in labels(figure)
    for ax, width in zip(figure.axes[3:], (3 * np.sqrt(1.2e-3), 3 * np.sqrt(1e-3), 3 * np.sqrt(2e-4)), strict=True):
        (area,) = (c for c in ax.collections if isinstance(c, PolyCollection))
        assert area.get_paths()[0].get_extents().y1 == pytest.approx(np.rad2deg(width))
    assert "3 sigma" not in labels(plots.euler(estimate(), motion()))


def test_an_unknown_covariance_has_no_band() -> None:
    figure = drawn(plots.euler(estimate(covariance=np.full((N, 3, 3), np.nan)), motion()))
    assert all(np.isfinite(ax.get_ylim()).all() for ax in figure.axes)


def test_doubled_times_do_not_break_lines() -> None:
    figure = plots.sensors(Recording(np.repeat(TIME[:50], 3), np.ones((150, 3))))
    assert np.isfinite(np.asarray(figure.axes[0].lines[0].get_ydata())).all()


def test_missing_samples_are_hatched() -> None:
    mag = sensed().mag
    assert mag is not None
    slow = np.where((np.arange(N) % 4 == 0)[:, None], mag, np.nan)
    plain = plots.sensors(sensed(mag=slow))
    assert "no samples" not in labels(plain)  # a slower sensor misses nothing
    assert np.isfinite(np.asarray(plain.axes[3].lines[0].get_ydata())).all()
    slow[1000:1500] = np.nan
    figure = plots.sensors(sensed(mag=slow))
    assert "no samples" in labels(figure)
    hatched = figure.axes[3].collections[0].get_paths()[0].get_extents()
    assert (hatched.x0, hatched.x1) == pytest.approx((9.96, 15.0))
    assert np.isnan(np.asarray(figure.axes[3].lines[0].get_ydata())).sum() == 1
    assert not figure.axes[0].collections


def test_times_since_1970_stay_readable() -> None:
    far = replace(motion(), time=TIME + 1.7e9)
    figure = plots.euler(far)
    assert figure.axes[-1].get_xlabel() == "time after 1700000000.000 s (s)"
    assert figure.axes[-1].get_xlim() == pytest.approx((0.0, TIME[-1]), abs=1e-5)


def test_long_recordings_are_thinned_and_keep_their_peaks() -> None:
    n = 200_000
    gyr = np.random.default_rng(4).normal(size=(n, 3))
    gyr[123_456, 1] = 50.0
    figure = plots.sensors(Recording(np.arange(n) / 1000.0, gyr))
    line = figure.axes[0].lines[1]
    assert len(np.asarray(line.get_xdata())) <= 4 * _lines.COLUMNS
    assert np.max(np.asarray(line.get_ydata())) == pytest.approx(np.rad2deg(50.0))


def test_styles_differ_in_colour_and_dash() -> None:
    colours, dashes = zip(*_canvas.STYLES, strict=True)
    assert len(set(colours)) == len(set(dashes)) == len(_canvas.STYLES)


def test_mistakes_get_one_clear_line() -> None:
    with pytest.raises(InputError, match="1 to 6 orientations in a figure, got 0"):
        plots.euler([])
    with pytest.raises(InputError, match="1 to 6 orientations in a figure, got 7; draw several"):
        plots.quaternion([motion()] * 7)
    with pytest.raises(InputError, match="orientations to draw, got Recording"):
        plots.euler([sensed()])  # type: ignore[list-item]
    with pytest.raises(InputError, match="orientations with samples, got none in walk"):
        plots.euler(motion()[:0])
    with pytest.raises(InputError, match="convention to be one of zyx, rfu"):
        plots.euler(motion(), convention="xyz")
    with pytest.raises(InputError, match="a recording with a reference"):
        plots.euler(motion(), sensed())
    with pytest.raises(InputError, match=r"errors from attitude_error\(\), got Orientation"):
        plots.errors([motion()])  # type: ignore[list-item]
    with pytest.raises(InputError, match="a Recording, got Orientation"):
        plots.sensors(motion())  # type: ignore[arg-type]
    with pytest.raises(InputError, match="a recording with samples, got none"):
        plots.sensors(sensed()[:0])
    with pytest.raises(InputError, match="time that does not run backwards"):
        plots.sensors(sensed()[::-1])

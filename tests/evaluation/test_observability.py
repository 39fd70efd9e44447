"""Observability: K06's figures, cases solved by hand, laws of invariance, words, and mistakes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.errors import InputError, NorthdownError
from northdown.evaluation import k06_configurations, observability
from northdown.evaluation.observability_changes import Changes, transitions
from northdown.evaluation.observability_models import parse_sensors
from northdown.simulation import (
    AboutAxis,
    Motion,
    Still,
    coning,
    k06_sine,
    pitch_sweep,
    random_motion,
    rest,
    steady,
    tumbling,
)

SLANTED = Rotation.from_euler("ZYX", [0.3, 0.2, -0.4])


def turn(axis, rate=0.5, attitude=SLANTED) -> Motion:
    """Steady turn about an axis of the body."""
    return Motion(AboutAxis(attitude, axis, steady(rate)), Still(), 0.0, 4.0, "turn")


ABOUT_VERTICAL = turn(SLANTED.inv().apply([0.0, 0.0, 1.0]))
FEW = {"times": np.linspace(0.1, 3.9, 7)}


# ---- K06 ----


@pytest.mark.parametrize("configuration", k06_configurations().values(), ids=k06_configurations())
def test_k06_figures(configuration):
    found = configuration.run()
    assert len(found) == 801
    assert configuration.agrees(found)
    n = found.states
    ratio = found.singular_values / found.singular_values[:, :1]
    # the gap that makes the tolerance harmless: zeros at rounding, the others far above
    assert ratio[:, n - configuration.zeros :].max(initial=0.0) < 2e-15
    assert ratio[:, n - configuration.zeros - 1].min() > 5e-4
    assert found.singular_values[:, n - configuration.zeros - 1].min() > 0.59
    lost = {"3.4": {"length of the quaternion"}, "3.7": {"heading"}, "3.8": {"heading"}, "3.11": {"heading"}}
    assert {f.text for f in found.findings} == lost.get(configuration.figure, set())


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("attitude", [Rotation.from_euler("Z", 0.34), SLANTED])
def test_k06_with_other_starts_dips_and_orders(attitude, order):
    motion = k06_sine(0.5, attitude=attitude)
    for configuration in k06_configurations().values():
        assert configuration.agrees(configuration.run(motion, order=order, dip=math.radians(38.0)))


def test_k06_as_printed_has_no_zero_in_figure_3_4():
    configurations = k06_configurations()
    for variant in ("printed-pitch", "printed-rate", "printed"):
        found = configurations["3.4"].run(variant=variant)
        assert found.observable
        assert not configurations["3.4"].agrees(found)
        # all others are as in the figures
        for figure, configuration in configurations.items():
            if figure != "3.4":
                assert configuration.agrees(configuration.run(variant=variant))


# ---- cases solved by hand ----

VERTICAL_BIAS = "gyroscope bias about the vertical"
CASES = [
    # gravity g alone, at rest: z = g, ż = g × (−b) tell two angles and the bias at right angles to g
    (rest(4.0, attitude=SLANTED), "acc", "gyr_bias", 4, {"heading", VERTICAL_BIAS}),
    # a second direction tells the rest
    (rest(4.0, attitude=SLANTED), "acc, mag", "gyr_bias", 6, set()),
    # gravity stays where it is in a body that turns about the vertical
    (ABOUT_VERTICAL, "acc", "gyr_bias", 4, {"heading", VERTICAL_BIAS}),
    # and moves in one that turns about another axis
    (turn((1.0, 0.0, 0.0)), "acc", "gyr_bias", 5, {"heading"}),
    # the field alone, likewise
    (rest(4.0, attitude=SLANTED), "mag", (), 2, {"rotation about the magnetic field"}),
    (
        rest(4.0, attitude=SLANTED),
        "mag",
        "gyr_bias",
        4,
        {"rotation about the magnetic field", "gyroscope bias about the magnetic field"},
    ),
    # one axis of the accelerometer at rest tells one angle
    (rest(4.0, attitude=Rotation.identity()), "acc x", (), 1, {"heading", "rotation about north"}),
    # level, the axis that points down tells nothing
    (rest(4.0), "acc z", (), 0, {"rotation about all axes"}),
    # nor does it a picoradian off level: that is rounding
    (rest(4.0, attitude=Rotation.from_rotvec([1e-12, 0.0, 0.0])), "acc z", (), 0, {"rotation about all axes"}),
    # with the angular acceleration known, the rate is as a bias
    (rest(4.0, attitude=SLANTED), "acc", "rate", 4, {"heading", "angular rate about the vertical"}),
    (rest(4.0, attitude=SLANTED), "acc, gyr", "rate", 5, {"heading"}),
    # gyroscopes alone tell only that rate and bias add up
    (rest(4.0, attitude=SLANTED), "acc, mag, gyr", ("rate", "gyr_bias"), 9, set()),
    # the field unknown too: gravity tells the tilt, the field's size its parts, and its horizontal part the heading
    (rest(4.0, attitude=SLANTED), "acc, mag", "field", 5, set()),
    # two axes of the field at rest, level: they tell heading and the horizontal part, not the vertical one
    (rest(4.0), "acc, mag xy", "field", 4, {"vertical part of the field"}),
    (rest(4.0), "acc, mag xy", "dip", 4, set()),
]


@pytest.mark.parametrize(("motion", "sensors", "unknown", "rank", "lost"), CASES)
@pytest.mark.parametrize("state", ["tangent", "euler", "quaternion+norm"])
def test_by_hand(motion, sensors, unknown, rank, lost, state):
    found = observability(motion, sensors, state=state, unknown=unknown, **FEW)
    assert set(found.rank) == {rank + (state == "quaternion+norm")}
    assert {f.text for f in found.findings} == lost
    assert all(f.share == 1.0 for f in found.findings)
    assert found.observable == (not lost)


def test_values_at_rest_level():
    """Accelerometer, level: ∂z/∂δ has two ones, and −ż is the bias about x and y once more."""
    found = observability(rest(4.0), "acc", state="tangent", unknown="gyr_bias", **FEW)
    np.testing.assert_allclose(found.singular_values, [[1, 1, 1, 1, 0, 0]] * 7, atol=1e-15)
    # with the field: Wᵀ W = 2 E − g gᵀ − m mᵀ with 60° between g and … 30°, so 1 ± cos 30° and 2
    found = observability(rest(4.0), "acc, mag", state="tangent", **FEW)
    squares = [2.0, 1.0 + math.cos(math.radians(30.0)), 1.0 - math.cos(math.radians(30.0))]
    np.testing.assert_allclose(found.singular_values**2, [squares] * 7, atol=1e-14)


# ---- invariance ----

attitudes = st.tuples(*[st.floats(-math.pi, math.pi)] * 3).map(
    lambda a: Rotation.from_euler("ZYX", [a[0], 0.4 * a[1], a[2]])  # pitch within ±72°
)


@given(attitudes, st.sampled_from(["acc", "mag", "acc, mag", "acc yz, mag x", "mag xz"]))
@settings(max_examples=15, deadline=None)
def test_rank_does_not_depend_on_how_the_attitude_is_written(attitude, sensors):
    motion = tumbling(2.0, attitude=attitude)
    times = [0.0, 0.01]
    for unknown in ((), ("gyr_bias",)):
        found = {
            state: observability(motion, sensors, state=state, unknown=unknown, times=times)
            for state in ("tangent", "euler", "quaternion+norm")
        }
        both = found["euler"].defined
        assert (found["tangent"].rank[both] == found["euler"].rank[both]).all()
        assert (found["tangent"].rank + 1 == found["quaternion+norm"].rank).all()
        assert found["tangent"].overall_unobservable == found["quaternion+norm"].overall_unobservable


@pytest.mark.parametrize("method", ["direct", "indirect"])
def test_quaternion_and_rotation_vector_differ_by_a_factor(method):
    # δq = ½ δ ⊗ q, so that along unit changes of q at right angles to it all derivatives are twice as large
    motion = coning(2.0, attitude=SLANTED)
    times = np.linspace(0.0, 2.0, 9)
    small = observability(motion, state="tangent", method=method, times=times).singular_values
    large = observability(motion, method=method, times=times).singular_values
    if method == "indirect":
        np.testing.assert_allclose(large[:, :3], 2.0 * small, rtol=1e-12)
        np.testing.assert_allclose(large[:, 3], 0.0, atol=1e-12 * large.max())
    else:
        # there the length adds to what is measured: singular values only grow (Cauchy's interlacing)
        assert (large[:, :3] >= 2.0 * small - 1e-9).all()


@given(st.floats(-3.0, 3.0))
@settings(max_examples=8, deadline=None)
def test_heading_does_not_matter_to_an_accelerometer(yaw):
    a = observability(tumbling(1.0), "acc", state="tangent", unknown="gyr_bias", times=[0.3, 0.9])
    turned = tumbling(1.0, attitude=Rotation.from_euler("Z", yaw))
    b = observability(turned, "acc", state="tangent", unknown="gyr_bias", times=[0.3, 0.9])
    np.testing.assert_allclose(a.singular_values, b.singular_values, rtol=1e-10, atol=1e-12)


def test_turning_about_the_vertical_changes_nothing_for_an_accelerometer():
    found = observability(ABOUT_VERTICAL, "acc", state="tangent", unknown="gyr_bias", **FEW)
    np.testing.assert_allclose(found.singular_values, found.singular_values[:1].repeat(7, axis=0), atol=1e-14)


def test_more_sensors_and_higher_orders_never_lose_rank():
    motion = random_motion(8.0, 3)
    times = np.linspace(0.0, 8.0, 33)
    kw = {"state": "tangent", "unknown": ("gyr_bias", "field"), "times": times}
    ranks = [observability(motion, "acc, mag", order=k, **kw).rank for k in range(4)]
    assert all((high >= low).all() for low, high in itertools.pairwise(ranks))
    assert (observability(motion, "acc, mag", **kw).rank >= observability(motion, "mag", **kw).rank).all()


# ---- results ----


def test_unobservable_directions_change_no_measurement():
    motion = random_motion(10.0, 1)
    found = observability(motion, "acc", unknown="gyr_bias")
    null = found.directions[500][found.rank[500] :]
    assert found.rank[500] == 6
    # heading: δq = ½ (0, 0, 0, 1) ⊗ q = ½ (−z, −y, x, w)
    w, x, y, z = motion.at(found.time[500]).quat[0]
    wanted = np.array([-z, -y, x, w, 0, 0, 0])
    np.testing.assert_allclose(np.abs(null[0] @ wanted), 1.0, atol=1e-12)


def test_rest_and_motion_in_one():
    found = observability(random_motion(20.0, 1), "acc", state="tangent", unknown="gyr_bias")
    resting = (found.time < 5.0) | (found.time > 15.0)
    assert (found.rank == np.where(resting, 4, 5))[np.abs(found.time - 10.0) != 5.0].all()
    assert [f.text for f in found.findings] == ["heading", VERTICAL_BIAS]
    assert found.findings[1].share == pytest.approx(0.5, abs=0.002)
    assert found.unobservable[0] == ("heading", VERTICAL_BIAS)
    assert (found.overall_rank, found.overall_unobservable) == (5, ("heading",))
    text = str(found)
    assert text == found.summary()
    for part in ("5 of 6 at 49.", VERTICAL_BIAS + " (50.", "rank 5 of 6 over all times", "1e-10 of the largest"):
        assert part in text
    assert "rank 4 to 5 of 6" in repr(found)
    table = found.to_pandas()
    assert list(table) == ["time", *(f"sigma_{k}" for k in range(1, 7)), "rank", "unobservable"]
    assert table["unobservable"].iloc[0] == f"heading; {VERTICAL_BIAS}"
    assert (table["sigma_6"].to_numpy() == found.smallest).all()
    assert table.attrs["states"] == list(found.model.state_names)


def test_mixed_directions_are_told_as_such():
    # gyroscope with an unknown bias, nothing else to tell the rate: they change together
    found = observability(rest(4.0), "gyr", state="tangent", unknown=("gyr_bias", "rate"), **FEW)
    assert set(found.rank) == {3}
    assert found.findings[0].text == "rotation about all axes"
    assert all(
        "gyroscope bias about" in f.text and "together with angular rate" in f.text for f in found.findings[1:]
    )


def test_weakest():
    # a shallow magnetic field tells heading, though badly
    found = observability(rest(4.0), state="tangent", dip=math.radians(85.0), **FEW)
    assert found.observable
    assert found.weakest == "heading"
    # level and at rest, an accelerometer tells both tilts equally well
    found = observability(rest(4.0), "acc", state="tangent", **FEW)
    assert set(found.weakest.split(" or ")) == {"rotation about north", "rotation about east"}


def test_undefined():
    motion = pitch_sweep(10.0, yaw=0.0)  # through +90° at about 1.35 s
    at = 10.0 * math.asin(0.75) / (2.0 * math.pi)
    found = observability(motion, state="euler", times=[0.5, at, 2.0])
    assert found.defined.tolist() == [True, False, True]
    assert np.isnan(found.singular_values[1]).all()
    assert (found.rank[1], found.unobservable[1]) == (0, ())
    assert not found.observable
    assert "at 33.3 % of the times: pitch near ±90°" in found.summary()
    assert observability(motion, times=[0.5, at, 2.0]).observable
    indirect = observability(motion, method="indirect", times=[at])
    assert "an angle near ±90°" in indirect.summary()
    assert "Rank" not in indirect.summary()
    assert indirect.overall_rank == 0
    # a heading of 90° matters to −tan ψ only
    east = rest(4.0, attitude=Rotation.from_euler("Z", math.pi / 2))
    assert not observability(east, method="indirect", **FEW).defined.any()
    assert observability(east, "acc", method="indirect", **FEW).defined.all()


def test_tolerance():
    found = observability(rest(4.0), state="tangent", dip=math.radians(85.0), **FEW)
    small = found.singular_values[0, 2] / found.singular_values[0, 0]
    assert small == pytest.approx(math.sqrt((1.0 - math.sin(math.radians(85.0))) / 2.0), rel=1e-9)
    strict = observability(rest(4.0), state="tangent", dip=math.radians(85.0), tolerance=0.09, **FEW)
    assert strict.tolerance > small
    assert set(strict.rank) == {2}
    assert [f.text for f in strict.findings] == ["heading"]


def test_taken_together_does_not_depend_on_where_one_looks():
    # from one time to the next the body turns by 6 rad; a bias is carried across as well as in short steps
    motion = tumbling(8.0, attitude=SLANTED)
    coarse = np.linspace(0.0, 6.0, 5)
    kw = {"state": "tangent", "unknown": "gyr_bias", "order": 0}
    few = observability(motion, "acc", times=coarse, **kw)
    # each of the coarse times once more, and between them many at which nothing new is added up
    fine = np.linspace(0.0, 6.0, 4001)
    many = observability(motion, "acc", times=fine, **kw)
    again = observability(motion, "acc", times=np.repeat(coarse, 3), **kw)
    np.testing.assert_allclose(few.overall, again.overall, atol=1e-12)
    assert few.overall_rank == many.overall_rank == 5
    changes = Changes(few.model, np.ascontiguousarray(motion.at(coarse).quat.T))
    short = Changes(few.model, np.ascontiguousarray(motion.at(fine).quat.T))
    np.testing.assert_allclose(
        transitions(few.model, changes, motion, coarse),
        transitions(few.model, short, motion, fine)[::1000],
        atol=1e-9,  # s, of up to 6
    )


def test_orientations_and_recordings():
    truth = random_motion(12.0, 5)
    orientation = truth.orientation(rate=100.0, frame="ENU")
    recording = nd.simulate(12.0, rate=50.0, seed=1)
    for trajectory in (orientation, recording):
        found = observability(trajectory, "acc", state="tangent", unknown="gyr_bias", order=0)
        assert set(found.rank) == {2}
        assert (found.overall_rank, found.overall_unobservable) == (5, ("heading",))
        # a period of 10 Hz off each end, where a spline is least certain
        np.testing.assert_allclose(found.time[[0, -1]], [0.1, 11.9], atol=1e-9)
    # close to the motion that it was taken from
    times = np.linspace(4.0, 8.0, 20)
    kw = {"state": "tangent", "unknown": "gyr_bias", "order": 2, "times": times}
    exact = observability(truth, "acc", **kw).singular_values
    np.testing.assert_allclose(observability(orientation, "acc", **kw).singular_values, exact, atol=1e-3)


def test_real_recording(data_root):
    recording = nd.datasets.broad(1, data_root)[:6000]
    part = nd.Recording(recording.time, recording.gyr, reference=recording.reference.at(recording.time[100:5900]))
    found = nd.observability(part, "acc", state="tangent", unknown="gyr_bias", order=0)
    assert found.overall_rank == 5
    assert found.overall_unobservable == ("heading",)
    assert nd.observability(part, "acc, mag", state="tangent", unknown="gyr_bias").observable


# ---- mistakes ----


@pytest.mark.parametrize(
    ("sensors", "options", "message"),
    [
        ("acc w", {}, "sensors such as"),
        ("", {}, "sensors such as"),
        ([], {}, "each axis of a sensor once, got none"),
        ("acc xx", {}, "acc_x twice"),
        ("acc, acc z", {}, "acc_z twice"),
        ("acc", {"state": "matrix"}, "state to be one of quaternion"),
        ("acc", {"method": "guess"}, "method to be one of direct"),
        ("acc", {"variant": "new"}, "variant to be one of scale-free"),
        ("acc", {"unknown": "bias"}, "unknown to be one of gyr_bias"),
        ("acc, mag", {"unknown": ("dip", "field")}, "either field or dip"),
        ("acc, gyr", {}, "leave gyr out"),
        ("acc", {"unknown": ("rate", "gyr_bias")}, "gyr among the sensors"),
        ("acc yz", {"method": "indirect"}, "use the direct method"),
        ("acc, mag xy", {"method": "indirect"}, "use the direct method"),
        ("acc, mag", {"method": "indirect", "unknown": "dip"}, "a known field"),
        ("acc", {"unknown": None}, "unknown as a name or several"),
        (None, {}, "sensors such as"),
        ("acc", {"order": 9}, "order between 0 and 8"),
        ("acc", {"order": 1.5}, "a whole number for order"),
        ("acc", {"tolerance": 0.0}, "tolerance"),
        ("acc", {"dip": 3.0}, "dip between"),
        ("acc", {"times": []}, "1 to 100000 times"),
        ("acc", {"times": [[1.0]]}, "1 to 100000 times"),
        ("acc", {"times": [1.0, math.nan]}, "finite time"),
        ("acc", {"times": [2.0, 1.0]}, "does not run backwards"),
    ],
)
def test_mistakes(sensors, options, message):
    with pytest.raises(InputError, match=message) as problem:
        observability(rest(4.0), sensors, **options)
    assert "\n" not in str(problem.value)


def test_mistakes_in_the_trajectory():
    with pytest.raises(InputError, match="times from 0 to"):
        observability(random_motion(4.0, 1).orientation(rate=50.0), "acc", times=[5.0])
    with pytest.raises(InputError, match="a recording with a reference"):
        observability(nd.Recording(np.arange(4.0), np.zeros((4, 3))), "acc")
    with pytest.raises(InputError, match="a Motion, an Orientation or a Recording, got str"):
        observability("walk.csv", "acc")
    with pytest.raises(InputError, match="times close enough to follow the motion, got 950 s between two"):
        observability(tumbling(1000.0), "acc", times=[0.0, 50.0, 1000.0])
    fast = turn((1.0, 0.0, 0.0), rate=40.0).orientation(rate=100.0)
    shaken = nd.Orientation.from_rotation(
        fast.time, fast.rotation * Rotation.random(len(fast), rng=np.random.default_rng(2)), "NED"
    )
    with pytest.raises(InputError, match="raise the bandwidth above 2 Hz"):
        observability(shaken, "acc", bandwidth=2.0)


@given(st.text(max_size=12))
@settings(max_examples=60, deadline=None)
def test_any_text_for_sensors(text):
    try:
        found = parse_sensors(text)
    except NorthdownError:
        return
    assert len(set(found)) == len(found) > 0
    assert set(found) <= {f"{s}_{a}" for s in ("acc", "mag", "gyr") for a in "xyz"}


def test_sensors():
    assert parse_sensors("mag xy, ACC z") == ("acc_z", "mag_x", "mag_y")
    assert parse_sensors(["acc_x", "mag", "gyr:z"]) == ("acc_x", "mag_x", "mag_y", "mag_z", "gyr_z")

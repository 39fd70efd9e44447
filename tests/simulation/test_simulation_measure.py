"""What error-free sensors measure, and that the result depends on the seed alone."""

from __future__ import annotations

import dataclasses
import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown import InputError
from northdown.simulation import (
    LOW_COST,
    MPU_9250,
    AboutAxis,
    Motion,
    SensorErrors,
    Shaking,
    Still,
    TriadErrors,
    coning,
    measure,
    measure_chunks,
    pitch_sweep,
    random_motion,
    replay,
    rest,
    simulate,
    steady,
)

FIELD = np.array([20.0, 3.0, 40.0])


def same(a, b) -> bool:
    """Byte by byte, NaN included."""
    fields = ("time", "gyr", "acc", "mag", "movement")
    pairs = [(getattr(a, k), getattr(b, k)) for k in fields]
    pairs += [(a.reference.quat, b.reference.quat), (a.reference.gyr_bias, b.reference.gyr_bias)]
    return all((x is None and y is None) or x.tobytes() == y.tobytes() for x, y in pairs)


@pytest.mark.parametrize("motion", [random_motion(20.0, 1), coning(20.0), pitch_sweep(20.0)], ids=lambda m: m.name)
def test_error_free_samples_integrate_to_the_truth(motion):
    recording = measure(motion, rate=200.0)
    step = np.diff(recording.time, prepend=recording.time[0])
    attitude = recording.reference.rotation[0]
    for rate, dt in zip(recording.gyr[1:], step[1:], strict=True):
        attitude = attitude * Rotation.from_rotvec(rate * dt)
    assert (attitude * motion.at(20.0).rotation.inv()).magnitude().max() < 1e-12  # rad, rounding of 4000 products
    # the first sample, too, is the mean over the period before it
    before = motion.at([-0.005, 0.0]).rotation
    assert np.allclose(recording.gyr[0], (before[0].inv() * before[1]).as_rotvec() / 0.005, atol=1e-12)


def test_irregular_times():
    time = np.cumsum(np.random.default_rng(0).uniform(0.001, 0.02, 800))
    recording = measure(random_motion(20.0, 1), time=time)
    assert np.array_equal(recording.time, time)
    attitude = recording.reference.rotation[0]
    for rate, dt in zip(recording.gyr[1:], np.diff(time), strict=True):
        attitude = attitude * Rotation.from_rotvec(rate * dt)
    assert (attitude * recording.reference.rotation[-1].inv()).magnitude() < 1e-12


def test_specific_force_and_field_in_the_navigation_frame():
    motion = random_motion(20.0, 1)
    recording = measure(motion, field=FIELD, gravity=9.7)
    truth = motion.at(recording.time)
    force = truth.rotation.apply(recording.acc)
    assert np.allclose(force - truth.acceleration, [0.0, 0.0, -9.7], atol=1e-12)
    assert np.allclose(truth.rotation.apply(recording.mag), FIELD, atol=1e-12)
    assert np.allclose(recording.acc, truth.specific_force(9.7), atol=1e-12)


def test_lever_arm_is_the_second_derivative_of_the_place():
    motion, arm, h = random_motion(20.0, 1), np.array([0.3, -0.2, 0.1]), 1e-3
    time = np.linspace(0.0, 20.0, 500)

    def place(t):
        state = motion.at(t)
        return state.position + state.rotation.apply(arm)

    around = [place(time + k * h) for k in (-2, -1, 0, 1, 2)]
    acceleration = sum(w * x for w, x in zip((-1, 16, -30, 16, -1), around, strict=True)) / (12.0 * h * h)
    force = motion.at(time).rotation.inv().apply(acceleration - [0.0, 0.0, 9.80665])
    recording = measure(motion, time=time, position=arm)
    assert np.abs(recording.acc - force).max() < 2e-8  # m/s²; rounding 1e-16 · 0.3 m · 64/(12 h²)
    assert np.abs(recording.acc - measure(motion, time=time).acc).max() > 0.1
    assert np.allclose(motion.at(time).specific_force(position=arm), recording.acc, atol=1e-12)


def test_centripetal_force_of_a_turntable():
    table = Motion(AboutAxis(Rotation.identity(), (0, 0, 1), steady(3.0)), Still(), 0.0, 2.0)
    recording = measure(table, position=(0.5, 0.0, 0.0))
    assert np.allclose(recording.acc, [-9.0 * 0.5, 0.0, -9.80665], atol=1e-12)
    assert np.allclose(recording.gyr, [0.0, 0.0, 3.0], atol=1e-12)


def test_movement_marks_turning_and_shifting():
    recording = measure(random_motion(20.0, 1, turn=0.0, reach=0.3))
    assert not recording.gyr.any()
    inside = (recording.time > 5.05) & (recording.time < 14.95)
    assert recording.movement[inside].all()
    assert not recording.movement[recording.time < 5.0].any()
    assert measure(rest(5.0)).movement is None
    assert measure(coning(5.0)).movement.all()


def test_frame_only_turns_the_truth():
    a, b = simulate(5.0, seed=1), simulate(5.0, seed=1, frame="ENU")
    assert np.array_equal(a.gyr, b.gyr)
    assert b.frame == "ENU"
    assert (a.reference.to_frame("ENU").rotation * b.reference.rotation.inv()).magnitude().max() < 1e-14
    assert not np.array_equal(a.gyr, simulate(5.0, seed=2).gyr)


SPOILED = dataclasses.replace(
    MPU_9250,
    gyr=dataclasses.replace(MPU_9250.gyr, bandwidth=41.0, walk=1e-5, dropout=0.02, dropout_length=3.0),
    acc=dataclasses.replace(MPU_9250.acc, bandwidth=20.0, order=2, rate=70.0, delay=0.003),
    mag=dataclasses.replace(MPU_9250.mag, rate=33.3, phase=0.004, dropout=0.1, delay=0.014),
    jitter=5e-4,
    stamp_noise=2e-4,
    loss=0.01,
    loss_length=5.0,
)


@pytest.mark.parametrize("errors", [LOW_COST, SPOILED], ids=["low-cost", "spoiled"])
def test_chunks_are_the_whole_byte_by_byte(errors):
    motion = random_motion(100.0, 3)
    whole = measure(motion, errors, 4, rate=200.0)
    assert len(whole) > 2 * 8192
    assert same(whole, measure(random_motion(100.0, 3), errors, 4, rate=200.0))
    assert not same(whole, measure(motion, errors, 5, rate=200.0))
    for chunk in (1000, 8192, 50_000):
        parts = list(measure_chunks(motion, errors, 4, rate=200.0, chunk=chunk))
        assert {len(p) for p in parts[:-1]} <= {chunk}
        for key in ("time", "gyr", "acc", "mag", "movement"):
            joined = np.concatenate([getattr(p, key) for p in parts])
            assert joined.tobytes() == getattr(whole, key).tobytes()
        assert np.concatenate([p.reference.quat for p in parts]).tobytes() == whole.reference.quat.tobytes()


@pytest.mark.parametrize("errors", [LOW_COST, SPOILED], ids=["low-cost", "spoiled"])
def test_processes_go_on_across_blocks(errors, monkeypatch):
    motion = random_motion(40.0, 3)
    whole = measure(motion, errors, 4, rate=200.0)
    monkeypatch.setattr("northdown.simulation.imu_bench.BLOCK", 777)
    pieces = measure(motion, errors, 4, rate=200.0)
    assert np.array_equal(whole.time, pieces.time)
    for name in ("gyr", "acc", "mag"):
        # the same numbers in other groups; only the rounding of sums differs
        assert np.allclose(getattr(whole, name), getattr(pieces, name), atol=1e-9, equal_nan=True)


def test_another_error_leaves_the_others_as_they_are():
    motion = random_motion(20.0, 3)
    plain = measure(motion, LOW_COST, 4)
    gyr = dataclasses.replace(LOW_COST.gyr, walk=1e-4, scale=0.01)
    other = measure(motion, dataclasses.replace(LOW_COST, gyr=gyr), 4)
    assert not np.array_equal(plain.gyr, other.gyr)
    assert np.array_equal(plain.acc, other.acc)
    drift = other.reference.gyr_bias - plain.reference.gyr_bias
    assert not drift[0].any()  # the same bias at turn-on, and a walk that begins at zero
    without = measure(motion, SensorErrors(gyr=dataclasses.replace(gyr, noise=0.0, bias=0.0)), 4)
    noise = plain.gyr - measure(motion).gyr - plain.reference.gyr_bias
    assert np.allclose(other.gyr - without.gyr, noise + plain.reference.gyr_bias, atol=1e-12)


def test_a_generator_gives_another_recording_each_time():
    rng = np.random.default_rng(3)
    first, second = (measure(rest(2.0), LOW_COST, rng) for _ in range(2))
    assert not np.array_equal(first.gyr, second.gyr)
    assert np.array_equal(first.gyr, measure(rest(2.0), LOW_COST, np.random.default_rng(3)).gyr)


def test_memory_does_not_grow_with_the_duration():
    errors = dataclasses.replace(LOW_COST, gyr=dataclasses.replace(LOW_COST.gyr, instability=1e-4, bandwidth=40.0))

    def peak(duration: float) -> int:
        tracemalloc.start()
        for _ in measure_chunks(rest(duration), errors, rate=100.0, chunk=8192):
            pass
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(10.0)  # what is loaded on first use
    assert peak(2000.0) < 1.2 * peak(500.0)


def test_missing_sensors_are_missing():
    recording = measure(rest(2.0), SensorErrors(gyr=None, mag=None))
    assert recording.gyr is None
    assert recording.mag is None
    assert recording.reference.gyr_bias is None
    assert np.allclose(recording.acc, [0.0, 0.0, -9.80665])


def test_replay_of_part_of_a_recording():
    truth = random_motion(30.0, 8).orientation(rate=50.0)[200:]
    recording = measure(replay(truth))
    assert recording.time[0] == pytest.approx(4.0)
    assert len(recording) == 2601
    # the sample's own period lies before the replay, which has no truth for it
    assert np.abs(recording.gyr[0] - recording.gyr[1]).max() < 1e-3


def test_simulate_names_what_it_is_made_of():
    assert simulate(2.0, seed=7).name == "simulated-random-7"
    recording = simulate(2.0, motion="k06-sine", sensors="adis16470", seed=1)
    assert recording.name == "simulated-k06-sine-adis16470-1"
    assert recording.mag is None
    assert simulate(motion=rest(3.0), name="mine").name == "mine"
    assert simulate(2.0, field=(0.0, 0.0, 50.0), gravity=1.0).acc.std() < 1.0


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: simulate(0.5), "duration of at least 1 s, got 0.5"),
        (lambda: simulate(10.0, rate=0.0), "rate between 1 and 10000 Hz"),
        (lambda: simulate(10.0, rate=1e9), "rate between"),
        (lambda: simulate(float("nan")), "duration"),
        (lambda: simulate(2.0, seed=-1), "seed that is a whole number"),
        (lambda: simulate(2.0, motion="fly"), "motion to be one of random, rest"),
        (lambda: simulate(2.0, sensors="mpu"), "preset to be one of perfect, low-cost"),
        (lambda: simulate(2.0, sensors=3), "name of sensors or SensorErrors, got int"),
        (lambda: simulate(2.0, motion=3), "a motion's name or a Motion, got int"),
        (lambda: simulate(2.0, frame="XYZ"), "frame to be one of"),
        (lambda: measure("walk"), "a Motion, got str"),
        (lambda: measure(rest(2.0), field=(1.0, 2.0)), "three finite numbers for field"),
        (lambda: measure(rest(2.0), position=(0.0, 0.0, np.nan)), "three finite numbers for position"),
        (lambda: measure(rest(2.0), time=[0.0, 1.0, 1.0]), "two increasing times"),
        (lambda: measure(rest(2.0), time=[0.0]), "two increasing times"),
        (lambda: measure(rest(2.0), disturbances=("magnet",)), "disturbances that are Dipoles, got str"),
        (lambda: next(measure_chunks(rest(2.0), chunk=0)), "a chunk of one sample"),
        (lambda: measure(replay(random_motion(5.0, 1).orientation()), time=[4.0, 6.0]), "times from 0 to 5 s"),
    ],
)
def test_mistakes_are_told(make, match):
    with pytest.raises(InputError, match=match):
        make()


def test_a_typing_error_is_an_error():
    with pytest.raises(TypeError, match="filed"):
        simulate(2.0, filed=(1.0, 0.0, 0.0))
    assert Shaking((0.1, 0.0, 0.0), 1.0).span[0] == -np.inf
    assert isinstance(TriadErrors().noise, np.ndarray)

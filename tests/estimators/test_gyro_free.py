"""What the filters without gyroscope do: consistency, pitch through 90°, dilution, and input that cannot do."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest
from array_truth import GRAVITY, coplanar, recorded, scattered
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import northdown as nd
from northdown import Flag, InputError, Recording
from northdown.arrays import AccelerometerArray
from northdown.estimators._array import reduce_array
from northdown.simulation import k06_sine, pitch_sweep, random_motion, rest

DIP = np.pi / 3.0
K06 = {"dip": DIP, "force_axes": "yz", "mag_axes": "xy", "motion_time": 0.0}


def squares(f, array, motion, seed):
    """NEES of attitude, mean square of rate error over sigma, half a second apart, from an in-model start."""
    r = recorded(motion, array, seed=seed)
    rng = np.random.default_rng(1000 + seed)
    error = Rotation.from_rotvec(rng.normal(size=3) * [f.start_tilt, f.start_tilt, f.start_heading])
    result = f.run(r, initial=error * r.reference.rotation[0])
    at = np.arange(400, len(r), 200)
    v = (r.reference.rotation[at] * result.rotation[at].inv()).as_rotvec()
    nees = np.einsum("ni,nij,nj->n", v, np.linalg.inv(result.covariance[at]), v)
    return nees.mean(), (((result.rate - r.reference.rate) / result.rate_sigma)[at] ** 2).mean()


@pytest.mark.parametrize(
    ("f", "array", "turn"),
    [
        (nd.GyroFreeDirect(dip=DIP, motion_time=0.0), coplanar(), 1.0),
        (nd.GyroFreeDirect(dip=DIP, motion_time=0.0, iterations=3), coplanar(), 1.0),
        (nd.GyroFreeDirect(**K06), coplanar(names="1 2 3y 4 5 6"), 0.15),
        (nd.GyroFreeDirect(**K06, iterations=3), coplanar(names="1 2 3y 4 5 6"), 0.15),
        (nd.GyroFreeDirect(motion_time=0.0), scattered(9), 1.0),
        (nd.GyroFreeIndirect(motion_time=0.0), coplanar(), 0.15),
        (nd.GyroFreeIndirect(iterations=3, motion_time=0.0), scattered(9), 0.15),
    ],
    ids=["direct", "direct iterated", "K06", "K06 iterated", "dip learned", "indirect", "indirect iterated"],
)
def test_covariance_is_honest(f, array, turn):
    """60 runs of in-model noise: mean NEES within the 95 % interval of χ² of the three degrees of freedom."""
    runs = 60
    both = np.array(
        [squares(f, array, random_motion(3.0, seed=s, turn=turn, reach=0.0), s) for s in range(runs)]
    ).mean(axis=0)
    # five samples of a run, half a second apart, count as two: errors stay correlated over 0.2 to 0.5 s
    low, high = chi2.ppf([0.025, 0.975], 3 * 2 * runs) / (3 * 2 * runs)
    assert low < both[0] / 3.0 < high
    assert low < both[1] < high


def test_k06_motion_iterated_and_not():
    """K06 4-1 with the sensors of its chapter 4: errors of the size that it prints, and no gain by iterating."""
    array = coplanar()
    error = {1: [], 3: []}
    for seed in range(20):
        r = recorded(k06_sine(), array, seed=seed)
        for n, found in error.items():
            result = nd.GyroFreeDirect(dip=DIP, iterations=n, motion_time=0.0).run(r)
            found.append((r.reference.rotation[-1] * result.rotation[-1].inv()).as_rotvec())
            assert result.rate_sigma[-1] == pytest.approx([0.055, 0.07, 0.08], rel=0.3)  # K06 table 4.5, rad/s
    size = {n: np.sqrt(np.mean(np.square(v))) for n, v in error.items()}
    assert size[3] == pytest.approx(size[1], rel=0.03)
    assert np.rad2deg(size[1]) == pytest.approx(0.24, rel=0.3)  # K06 table 4.7, rms of 0.19, 0.18 and 0.34°


def test_iterating_helps_from_a_bad_start():
    r = recorded(rest(0.2), scattered(9), seed=1)
    off = Rotation.from_euler("ZYX", [1.5, 0.8, -0.7])
    worse, better = (
        nd.GyroFreeDirect(dip=DIP, start_tilt=1.0, start_heading=1.0, iterations=n).run(r, initial=off)
        for n in (1, 10)
    )
    errors = [(x.rotation[5] * r.reference.rotation[5].inv()).magnitude() for x in (worse, better)]
    assert errors[1] < 0.1 * errors[0]
    assert errors[1] < 0.03  # rad: noise of a few samples


@pytest.fixture(scope="module")
def sweeps():
    return [recorded(pitch_sweep(20.0), coplanar(), seed=s) for s in range(5)]


class TestPitchThrough90:
    @pytest.mark.parametrize("options", [{}, {"iterations": 3}, K06], ids=["EKF", "IEKF", "K06"])
    def test_direct_works(self, sweeps, options):
        f = nd.GyroFreeDirect(**{"dip": DIP, **options})
        for r in sweeps:
            error = (f.run(r).rotation * r.reference.rotation.inv()).magnitude()
            assert np.rad2deg(np.sqrt(np.mean(error**2))) < 1.0

    def test_indirect_is_flagged_and_admits_its_error(self, sweeps):
        f = nd.GyroFreeIndirect()
        for r in sweeps:
            result = f.run(r)
            pitch = np.abs(r.reference.as_euler()[:, 1])
            assert result.has(Flag.NEAR_SINGULAR)[pitch > 1.5].all()
            assert not result.has(Flag.NEAR_SINGULAR)[pitch < 1.0].any()
            v = (r.reference.rotation * result.rotation.inv()).as_rotvec()
            nees = np.einsum("ni,nij,nj->n", v, np.linalg.inv(result.covariance), v)
            # 36 is one in 10⁷ of χ² with three degrees of freedom; the errors here have heavier tails
            assert nees.max() < 36.0
            size = np.trace(result.covariance, axis1=1, axis2=2)
            assert size[pitch > 1.5].mean() > 3.0 * size[400:][pitch[400:] < 1.0].mean()

    def test_tangents_fail_but_are_flagged(self, sweeps):
        """K06 4-2: the estimate of the indirect method fails."""
        worst = 0.0
        for r in sweeps:
            result = nd.GyroFreeIndirect(residual="tangent").run(r)
            # an estimate that is lost leaves only the noisy measurement to tell
            assert result.has(Flag.NEAR_SINGULAR)[np.abs(r.reference.as_euler()[:, 1]) > 1.5].mean() > 0.9
            worst = max(worst, (result.rotation * r.reference.rotation.inv()).magnitude().max())
        assert worst > 0.5


def steady(f, array, rate):
    """Covariance of (δ, ω half a sample before) at rest and level, by the Riccati equation with J⁺'s noise."""
    inverse = np.linalg.pinv(array.matrix)
    dt = 1.0 / rate
    C = f.acc_noise**2 / dt * inverse @ inverse.T
    u = np.array([np.cos(f.dip), 0.0, np.sin(f.dip)])
    H = np.zeros((6, 6))
    for rows, v in ((slice(0, 3), np.array([0.0, 0.0, -f.gravity])), (slice(3, 6), u)):
        H[rows, :3] = np.cross(v, np.eye(3)).T  # v × δ
    noise = np.zeros((6, 6))
    noise[:3, :3], noise[3:, 3:] = C[3:, 3:], (f.mag_noise / f.field) ** 2 / dt * np.eye(3)
    F = np.eye(6) + dt * np.eye(6, k=3)
    by = np.vstack([dt * dt * np.eye(3), dt * np.eye(3)])
    cross = np.hstack([-by @ C[:3, 3:], np.zeros((6, 3))])
    prior = solve_discrete_are(F.T, H.T, by @ C[:3, :3] @ by.T, noise, s=cross)
    after = prior - prior @ H.T @ np.linalg.solve(H @ prior @ H.T + noise, H @ prior)
    left = C[:3, :3] - C[:3, 3:] @ np.linalg.solve(C[3:, 3:], C[3:, :3])
    return np.sqrt(np.diag(after)[3:] + 0.25 * dt * dt * np.diag(left))


def test_error_falls_with_the_number_of_accelerometers_as_predicted():
    f, rate, found, predicted = nd.GyroFreeDirect(dip=DIP, motion_time=0.0), 400.0, [], []
    for count in (7, 9, 12):
        array = scattered(count, seed=8)
        r = recorded(rest(100.0), array, rate=rate, seed=count)
        settled = f.run(r, initial=r.reference.rotation[0])[2000:]
        found.append(np.sqrt(np.mean(settled.rate**2, axis=0)))
        predicted.append(steady(f, array, rate))
        assert found[-1] == pytest.approx(predicted[-1], rel=0.15)
        assert settled.rate_sigma[-1] == pytest.approx(predicted[-1], rel=0.01)
    assert np.mean(predicted[2]) < 0.8 * np.mean(predicted[0])


def test_no_drift_at_rest():
    """K06 4-3: ten minutes at rest end as near to the truth as they begin."""
    r = recorded(rest(600.0), coplanar(0.1), rate=100.0, seed=3)
    error = (nd.GyroFreeDirect().run(r).rotation * r.reference.rotation.inv()).magnitude()
    rms = np.sqrt(np.mean(error[1001:].reshape(59, 1000) ** 2, axis=1))
    assert rms[-10:].mean() < 1.2 * rms[:10].mean()


class TestMagnetometerOfTwoAxes:
    def test_third_may_be_missing(self):
        r = recorded(random_motion(4.0, seed=2, turn=0.15, reach=0.0), coplanar(names="1 2 3y 4 5 6"), seed=2)
        f = nd.GyroFreeDirect(**K06)
        blind = dataclasses.replace(r, mag=r.mag * [1.0, 1.0, np.nan])
        result = f.run(blind)
        assert not result.flags.any()
        assert np.array_equal(f.run(r).quat, result.quat)
        error = (result.rotation * r.reference.rotation.inv()).magnitude()
        assert error[800:].max() < 0.05
        stream = f.for_recording(blind).stream(rate=400.0)
        for channels, mag in zip(blind.array_acc[:50], blind.mag, strict=False):
            q = stream.update(channels, mag=mag)
        assert np.abs(q - result.quat[49]).max() < 1e-12

    def test_field_must_be_known(self):
        with pytest.raises(InputError, match=r"a known field .*two axes, got no dip; give dip"):
            nd.GyroFreeDirect(mag_axes="xy")


@pytest.fixture(scope="module")
def result():
    r = recorded(random_motion(5.0, seed=6, reach=0.0), coplanar(), seed=6)
    return nd.GyroFreeDirect().run(r), r


class TestOutput:
    def test_rate_in_table_and_slices(self, result):
        o, _ = result
        table = o.to_pandas()
        assert np.array_equal(table[[f"rate_{c}" for c in "xyz"]].to_numpy(), o.rate)
        assert np.array_equal(table[[f"rate_sigma_{c}" for c in "xyz"]].to_numpy(), o.rate_sigma)
        assert np.array_equal(o[10:20].rate, o.rate[10:20])
        assert "rate" in repr(o)
        halfway = o.at(o.time[:2].mean())
        assert halfway.rate == pytest.approx(o.rate[:2].mean(axis=0)[None])

    def test_rate_turns_with_the_body_only(self, result):
        o, r = result
        turn = Rotation.from_euler("ZYX", [0.4, -0.2, 1.0])
        turned = nd.GyroFreeDirect().run(r.rotate_body(turn.as_matrix()))
        # rounding, amplified over 2000 steps
        assert np.abs(turned.rate - turn.apply(o.rate)).max() < 1e-8
        body = o.turned(right=turn.inv())
        assert np.abs(body.rate - turned.rate).max() < 1e-8
        assert body.rate_sigma is None
        assert np.array_equal(o.to_frame("ENU").rate, o.rate)
        assert np.abs(nd.GyroFreeDirect().run(r, frame="ENU").rate - o.rate).max() < 1e-8


class TestBadInput:
    def test_no_array(self):
        r = nd.simulate(1.0)
        with pytest.raises(InputError, match="array for gyro-free-direct, got no array"):
            nd.GyroFreeDirect().run(r)
        with pytest.raises(
            InputError, match=r"geometry of an accelerometer array, got none; give GyroFreeDirect\(array"
        ):
            nd.GyroFreeDirect().stream(rate=100.0)

    @pytest.mark.parametrize("count", [1, 5])
    def test_too_few(self, count):
        with pytest.raises(InputError, match=f"six accelerometers or more, got {count}"):
            nd.GyroFreeDirect(array=scattered(count)).stream(rate=100.0)

    def test_singular(self):
        two = AccelerometerArray(np.repeat([[0.1, 0, 0], [-0.1, 0, 0]], 3, axis=0), np.tile(np.eye(3), (2, 1)))
        with pytest.raises(InputError, match="no accelerometer measures angular acceleration about x; move or turn"):
            nd.GyroFreeDirect(array=two).stream(rate=100.0)

    def test_other_array_than_the_recordings(self):
        r = recorded(rest(1.0), coplanar(), seed=0)
        with pytest.raises(InputError, match="9 channels of the array for gyro-free-direct, got 7"):
            nd.GyroFreeDirect(array=scattered(9)).run(r)

    def test_update_says_what_is_wrong(self):
        stream = nd.GyroFreeDirect(array=coplanar()).stream(rate=100.0)
        with pytest.raises(InputError, match=r"channels of shape \(7,\), got shape \(6,\)"):
            stream.update(np.zeros(6))
        with pytest.raises(InputError, match="no acc beside the channels"):
            stream.update(np.zeros(7), np.zeros(3))
        with pytest.raises(InputError, match="finite numbers in channels, got infinity, at sample 0"):
            stream.update(np.full(7, np.inf))
        with pytest.raises(InputError, match="real numbers in channels"):
            stream.update("channels")

    @pytest.mark.parametrize("bad", [0, 1.5, 21, "two"])
    def test_iterations(self, bad):
        with pytest.raises(InputError, match="iterations"):
            nd.GyroFreeIndirect(iterations=bad)

    def test_silent_array(self):
        r = recorded(rest(1.0), coplanar(), seed=0)
        channels = r.array_acc.copy()
        channels[100:150, 3] = np.nan
        with pytest.raises(InputError, match=r"expected an array sample at least every 0\.1 s, got NaN for longer"):
            nd.GyroFreeDirect().run(dataclasses.replace(r, array_acc=channels))


def test_stream_can_be_pickled():
    r = recorded(rest(1.0), coplanar(), seed=0)
    stream = nd.GyroFreeDirect(array=coplanar()).stream()
    stream.run(r[:200])
    copy = pickle.loads(pickle.dumps(stream))
    assert np.array_equal(copy.run(r[200:]).quat, stream.run(r[200:]).quat)


def test_coplanar_geometry_gives_k06_gravity_components():
    """K06 (2.26): g_x from A1 and A3x alone, g_y from A2 and A3y, with weights of a half, no rates leaking in."""
    array = coplanar(names="1 2 3x 3y 4 5 6")
    state = k06_sine().at(np.linspace(0.0, 0.4, 50))
    y = np.column_stack(
        [state.specific_force(GRAVITY, r) @ d for r, d in zip(array.position, array.direction, strict=True)]
    )
    force = state.specific_force(GRAVITY)
    assert np.abs(0.5 * (y[:, 0] - y[:, 2]) - force[:, 0]).max() < 1e-12
    assert np.abs(0.5 * (y[:, 1] + y[:, 3]) - force[:, 1]).max() < 1e-12
    made = reduce_array(array)
    assert np.abs(made.products[3:5]).max() < 1e-12
    assert Recording(state.time, array=array, array_acc=y).array is array

"""The parameters of the calibrating filter, and what its kernel makes of them."""

from __future__ import annotations

from dataclasses import dataclass

from northdown.estimators._calibrating_layout import Terms
from northdown.estimators.base import Estimator, parameter

# (m/s)² s, how surely a body at rest has velocity zero: a drift of centimetres, not of noise.
REST_SPEED = 1e-5


@dataclass(frozen=True, kw_only=True)
class CalibrationParameters(Estimator):
    """Parameters of the filter that calibrates its sensors.

    Parameters
    ----------
    gyr_noise : float
        White noise density of the gyroscope, rad/s/√Hz. Raising it trusts the other sensors more.
    gyr_scale : float
        Noise density that grows with the rate, as a fraction of it per √Hz, for what `gyr_matrix` leaves over.
        Raising it trusts the gyroscope less in fast motion.
    gyr_bias_walk : float
        Random walk of the bias, rad/s²/√Hz. Raising it lets the bias change faster and makes it noisier.
    acc_noise : float
        Noise density of velocity from the accelerometer, m/s²/√Hz. Raising it levels more slowly.
    acc_motion : float
        Growth of that variance with the square of linear acceleration, s⁴/m². Raising it trusts the accelerometer
        less in motion.
    speed_noise : float
        How far the velocity is from zero, m/s/√Hz. Raising it levels more slowly and forgives longer accelerations.
    speed_motion : float
        Growth of that variance with the mean square of linear acceleration, s⁴/m². Raising it levels more slowly in
        and after motion.
    motion_window : float
        Time constant (s) of that mean. Raising it distrusts for longer after each acceleration.
    acc_gate : float
        By how much specific force, averaged, must be more than usual for acceleration that lasts to be seen, m/s².
        Raising it lets stronger accelerations tilt the attitude, and is misled less by a badly calibrated sensor.
    acc_share : float
        Part of the variation of specific force's norm that a bias of the accelerometer must explain to be taken out;
        1 for never. Raising it needs surer evidence, and leaves a larger bias in.
    mag_noise : float
        Noise density of the heading from the magnetometer, rad/√Hz. Raising it makes heading follow more slowly.
    norm_gate : float
        Relative departure of the field's norm that makes u = 1. Raising it accepts more disturbance.
    dip_gate : float
        Departure of the field's dip, rad, that makes u = 1. Raising it accepts more disturbance.
    gate_power : float
        Power of 1 + u by which a departure raises the variance. Raising it rejects more sharply.
    gate_window : float
        Time constant (s) of the mean departure that counts where it is more than the present one; 0 for none. Raising
        it distrusts the field for longer after a disturbance, and moments at which a disturbed field looks right.
    field_window : float
        Time constant (s) with which the reference of norm and dip follows the field. Raising it adapts more slowly to
        a new place, and is fooled less by a long disturbance.
    field_new : float
        Time (s), in motion, for which another field must have been steady to become the reference. Raising it holds
        to the old field for longer.
    iron_share : float
        Part of the variation of the field in navigation axes that hard iron on the body must explain to be taken out;
        1 for never. Raising it needs surer evidence, and leaves larger iron in.
    rest_gyr : float
        Largest scatter of the gyroscope at rest, rad/s, root of the sum over the axes; 0 for no rest detection.
        Raising it takes more for rest.
    rest_acc : float
        The same of the accelerometer, m/s². Raising it takes more for rest.
    rest_rate : float
        Largest mean rate, less the bias known, at rest, rad/s. Raising it takes slow turns for rest.
    rest_window : float
        Time (s) over which scatter is judged. Raising it finds rest later, and more surely.
    rest_noise : float
        Least noise density of the gyroscope at rest, rad/s/√Hz. Raising it learns the bias more slowly at rest.
    rest_offset : float
        Standard deviation of the difference between the bias at rest and in motion, rad/s. Raising it trusts the bias
        found at rest less in motion.
    gyr_matrix : float
        Standard deviation of each entry of the gyroscope's scale and misalignment matrix; 0 for none. Raising it
        learns a worse calibration faster.
    mag_delay : float
        Delay of the magnetometer behind the gyroscope to start from, s. Raising it takes the field for older.
    mag_delay_sigma : float
        Its standard deviation, s; 0 keeps it fixed. Raising it learns the delay faster.
    calibration_time : float
        Time (s) in which the calibration may drift by as much as it is uncertain at the start. Raising it holds to
        what has been learnt.
    epoch : float
        Time between measurement updates, s. Raising it is faster, and coarser.
    gyr_range : float
        Rate at which the gyroscope clips, rad/s; 0 to find it from the data. Raising it beyond what the sensor can do
        makes clipping go unseen.
    gyr_delay : float
        Delay of the gyroscope behind the time of its samples, s; the attitude is turned on by as much. Raising it
        turns further ahead. No other sensor can tell: give it only when it is known.
    gravity : float
        Local gravity, m/s². Raising it expects more specific force at rest.
    start_tilt : float
        Standard deviation of the starting attitude about a horizontal axis, rad. Raising it converges faster from a
        bad start and more nervously from a good one.
    start_heading : float
        The same about the vertical. Raising it turns faster to the magnetometer's north at first.
    start_bias : float
        Standard deviation of the bias at the start, rad/s. Raising it learns the bias faster at first.
    heading_outlier : float
        Number of robust standard deviations from the smoothed heading above which a heading counts less in `smooth`,
        by the square of it; 0 leaves all weights as they are in real time. Raising it believes a wrong field more.
    smooth_walk : float
        Part of `gyr_bias_walk` that counts in `smooth`. In real time the bias also makes up for calibration not yet
        known. Raising it lets the smoothed bias change faster.
    inflation : float
        Factor κ on the reported standard deviations. Raising it widens them.
    tilt_sigma : float
        Least standard deviation of tilt that is reported, rad. Raising it widens the band.
    heading_sigma : float
        Standard deviation of heading from iron on the body that the recording does not show yet, rad. It falls to a
        fifth once the body has turned enough to show none; what it does show adds as much for each 0.01 rad by which
        it would turn the heading. Raising it widens the band.
    time_sigma : float
        Standard deviation of the moment for which an attitude stands, s. Raising it widens the bands in fast motion.
    """

    gyr_noise: float = parameter(1e-4, unit="rad/s/√Hz", above=0.0)
    gyr_scale: float = parameter(1e-4, unit="1/√Hz", low=0.0)
    gyr_bias_walk: float = parameter(5e-5, unit="rad/s²/√Hz", low=0.0)
    acc_noise: float = parameter(0.01, unit="m/s²/√Hz", above=0.0)
    acc_motion: float = parameter(1e-3, unit="s⁴/m²", low=0.0)
    speed_noise: float = parameter(0.05, unit="m/s/√Hz", above=0.0)
    speed_motion: float = parameter(0.1, unit="s⁴/m²", low=0.0)
    motion_window: float = parameter(1.0, unit="s", above=0.0)
    acc_gate: float = parameter(0.15, unit="m/s²", above=0.0)
    acc_share: float = parameter(0.4, low=0.0, high=1.0)
    mag_noise: float = parameter(0.02, unit="rad/√Hz", above=0.0)
    norm_gate: float = parameter(0.05, above=0.0)
    dip_gate: float = parameter(0.05, unit="rad", above=0.0)
    gate_power: float = parameter(2.0, low=0.0)
    gate_window: float = parameter(0.5, unit="s", low=0.0)
    field_window: float = parameter(200.0, unit="s", above=0.0)
    field_new: float = parameter(60.0, unit="s", above=0.0)
    iron_share: float = parameter(0.8, low=0.0, high=1.0)
    rest_gyr: float = parameter(0.005, unit="rad/s", low=0.0)
    rest_acc: float = parameter(0.15, unit="m/s²", low=0.0)
    rest_rate: float = parameter(0.035, unit="rad/s", low=0.0)
    rest_window: float = parameter(1.0, unit="s", low=0.1, high=1.5)
    rest_noise: float = parameter(1e-4, unit="rad/s/√Hz", above=0.0)
    rest_offset: float = parameter(1e-4, unit="rad/s", low=0.0)
    gyr_matrix: float = parameter(1e-3, low=0.0)
    mag_delay: float = parameter(0.0, unit="s", low=-0.05, high=0.05)
    mag_delay_sigma: float = parameter(0.02, unit="s", low=0.0, high=0.05)
    calibration_time: float = parameter(36000.0, unit="s", above=0.0)
    epoch: float = parameter(0.04, unit="s", low=0.03, high=0.5)
    gyr_range: float = parameter(0.0, unit="rad/s", low=0.0)
    gyr_delay: float = parameter(0.0, unit="s", low=-0.05, high=0.05)
    gravity: float = parameter(9.80665, unit="m/s²", above=0.0)
    start_tilt: float = parameter(0.05, unit="rad", above=0.0)
    start_heading: float = parameter(0.2, unit="rad", above=0.0)
    start_bias: float = parameter(0.02, unit="rad/s", above=0.0)
    heading_outlier: float = parameter(3.0, low=0.0)
    smooth_walk: float = parameter(0.5, low=0.0)
    inflation: float = parameter(1.0, above=0.0)
    tilt_sigma: float = parameter(0.003, unit="rad", low=0.0)
    heading_sigma: float = parameter(0.015, unit="rad", low=0.0)
    time_sigma: float = parameter(0.0015, unit="s", low=0.0)

    def _terms(self) -> Terms:
        return Terms(
            gyr=self.gyr_noise**2,
            scale=self.gyr_scale**2,
            walk=self.gyr_bias_walk**2,
            velocity=self.acc_noise**2,
            velocity_motion=self.acc_motion,
            speed=self.speed_noise**2,
            speed_motion=self.speed_motion,
            motion_window=self.motion_window,
            acc_gate=self.acc_gate,
            acc_share=self.acc_share,
            mag=self.mag_noise**2,
            norm_gate=self.norm_gate,
            dip_gate=self.dip_gate,
            gate_power=self.gate_power,
            gate_window=self.gate_window,
            field_window=self.field_window,
            field_new=self.field_new,
            iron_share=self.iron_share,
            rest_gyr=self.rest_gyr**2,
            rest_acc=self.rest_acc**2,
            rest_mean=self.rest_rate,
            rest_window=self.rest_window,
            rest_speed=REST_SPEED,
            rest_bias=self.rest_noise**2,
            gyr_delay=self.gyr_delay,
            gravity=self.gravity,
            epoch=self.epoch,
            calibration_time=self.calibration_time,
            matrix=self.gyr_matrix**2,
            offset=self.rest_offset**2,
            delay=self.mag_delay_sigma**2,
            start_delay=self.mag_delay,
            start_tilt=self.start_tilt**2,
            start_heading=self.start_heading**2,
            start_bias=self.start_bias**2,
            inflation=self.inflation**2,
            tilt_floor=self.tilt_sigma**2,
            heading_floor=self.heading_sigma**2,
            time_floor=self.time_sigma**2,
        )

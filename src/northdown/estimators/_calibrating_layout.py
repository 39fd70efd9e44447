"""Where the numbers of the calibrating filter stand in its state array, and in the vector of its errors."""

from __future__ import annotations

from typing import Final, NamedTuple

from northdown.kernels.rows import WIDTH

# Errors, in the order of the covariance's rows.
N: Final = 22
ATTITUDE, BIAS, VELOCITY, MATRIX, OFFSET, DELAY = 0, 3, 6, 9, 18, 21

# Nominal values, from the head of the state array.
QUAT: Final = 0
GYR_BIAS: Final = 4
SPEED: Final = 7
GYR_MATRIX: Final = 10  # by columns
REST_OFFSET: Final = 19
MAG_DELAY: Final = 22

# What is carried from sample to sample.
MOTION: Final = 23  # mean square of linear acceleration
AGE_ACC: Final = 24  # time since the sensor's last sample
AGE_MAG: Final = 25
FIELD: Final = 26  # reference: horizontal, down, age
DEPARTURE: Final = 29  # by which the last heading was weighed
STILL: Final = 30
GIVEN: Final = 31  # kind of rest as found beforehand; negative where the filter finds it itself
DENSITY: Final = 32  # spectral density of the gyroscope's noise in the window of rest
CLOSED: Final = 33  # whether the last sample closed an epoch
RATE: Final = 34  # angular rate, body axes
NEW_FIELD: Final = 37  # another field: horizontal, down, for how long it has been seen
MEAN_DEPARTURE: Final = 40  # over the last moments

# Sums over the samples of an epoch; all of them are cleared before the next.
SUMS: Final = 41
TIME: Final = 41
TIME_ACC: Final = 42
COUNT_MAG: Final = 43
RATE_SQUARE: Final = 44
ACC_SQUARE: Final = 45
CLIPPED: Final = 46  # standard deviation of the angle lost at the end of the range, navigation axes
COASTED: Final = 49  # what acceleration that lasts adds to the variance of velocity
LOST: Final = 50  # what an attitude that must be wrong adds to its variance
UNSEEN: Final = 51  # variance of the turn that a long step may have hidden
NEW_HEADING: Final = 52  # variance of a heading that has been found wrong
TURN: Final = 53  # Σ R dt by rows
SCALED: Final = 62  # Σ R r_k dt in motion, three matrices by rows, one after the other
REST_TURN: Final = 89  # Σ R dt at rest
FORCE: Final = 98  # Σ R a dt
N_MOVE: Final = 60  # numbers from TIME to FORCE
SHIFT: Final = 101  # Σ (R a + g) dt
FIELD_SUM: Final = 104
FIELD_SLOPE: Final = 107  # its derivative with respect to the delay
BLOCK: Final = 110  # the epoch's statistics, as `kernels.stillness` keeps them
N_BLOCK: Final = 10
SUMS_END: Final = BLOCK + N_BLOCK

# Turns of the last moments, for the delayed attitude.
CLOCK: Final = SUMS_END
TURNED: Final = CLOCK + 1  # rotation vectors, summed up
HEAD: Final = TURNED + 3
RING: Final = HEAD + 1
N_RING: Final = 32

# Statistics of the last epochs.
BLOCK_HEAD: Final = RING + 4 * N_RING
BLOCKS: Final = BLOCK_HEAD + 1
N_BLOCKS: Final = 64

# The gyroscope at the end of its range; entries for three axes, or for the two sides of each.
LEVELS: Final = BLOCKS + N_BLOCKS * N_BLOCK  # from where on it clips; infinite where it does not
PEAKS: Final = LEVELS + 6  # largest rate seen, where clipping was looked for
LAST_GYR: Final = PEAKS + 6
AGE_GYR: Final = LAST_GYR + 3  # time since its output last changed
ALERT: Final = AGE_GYR + 1  # rate below which there is nothing to watch
CLIPPING: Final = ALERT + 1  # for how long any axis has been clipped
SLOPE: Final = CLIPPING + 1  # change between the last two samples, rad/s²
QUANTUM: Final = SLOPE + 3  # least change seen on any axis; NaN at first
HELD_TIME: Final = QUANTUM + 1  # for how long an axis alone has repeated its value
HELD_SLOPE: Final = HELD_TIME + 3  # how it came there
CLIP_TIME: Final = HELD_SLOPE + 3  # for how long an axis has been clipped; 0 where it is not
CLIP_SLOPE: Final = CLIP_TIME + 3  # how it came there
CLIP_ADDED: Final = CLIP_SLOPE + 3  # angle added meanwhile

# Acceleration that lasts.
LOW_FORCE: Final = CLIP_ADDED + 3  # specific force, navigation axes, low-passed
NORM: Final = LOW_FORCE + 3  # norm of that to compare with, and for how long it has been learnt
SURPRISE: Final = NORM + 2  # mean square of the velocity's innovation in units of its variance
HOLD: Final = SURPRISE + 1  # for how long yet the accelerometer is not believed
TRAVEL: Final = HOLD + 1  # how surely the body is a vehicle
LAST_FORCE: Final = TRAVEL + 1  # of the last epoch
FORCE_CHANGE: Final = LAST_FORCE + 3  # mean square of its change from epoch to epoch
HELD: Final = FORCE_CHANGE + 1  # time of holds
PATIENCE: Final = HELD + 1  # time until a hold may begin for which force gives no reason
MISSED: Final = PATIENCE + 1  # variance of an attitude that has been found wrong, for the next epoch

# What the field says of iron on the body: sums, and what follows from them.
IRON: Final = MISSED + 1
IRON_TURN: Final = IRON + 16  # heading by which it would turn the field on average
IRON_KNOWN: Final = IRON_TURN + 1  # part of the variance of that heading that is no longer open

# Hard iron that is so large that it is taken out.
MAG_IRON: Final = IRON_KNOWN + 1  # the iron, body axes
IRON_STATE: Final = MAG_IRON + 3  # 0 none found, 1 found, -1 as given
IRON_CENTRE: Final = IRON_STATE + 1  # the iron expected
IRON_VARIANCE: Final = IRON_CENTRE + 3  # its variance; infinite where only its usual size is known
IRON_HEADING: Final = IRON_VARIANCE + 1  # variance of heading from what the iron found may be wrong by
IRON_WRONG: Final = IRON_HEADING + 1  # for how long the field has not been as it should be without it
IRON_TURNED: Final = IRON_WRONG + 1  # variance of the heading that was wrong by it, for the next epoch
FIELD_SUMS: Final = IRON_TURNED + 1  # sums as those above, of the field with the iron in it
FIELD_SQUARE: Final = FIELD_SUMS + 16

# A bias of the accelerometer that is so large that it is taken out.
ACC_BIAS: Final = FIELD_SQUARE + 1  # the bias, body axes
ACC_STATE: Final = ACC_BIAS + 3  # 0 none found, 1 found, -1 as given
ACC_CENTRE: Final = ACC_STATE + 1  # the bias expected
ACC_VARIANCE: Final = ACC_CENTRE + 3  # its variance; infinite where only its usual size is known
ACC_TILT: Final = ACC_VARIANCE + 1  # variance of tilt from what the bias found may be wrong by
LOW_UP: Final = ACC_TILT + 1  # upwards, body axes, low-passed as the specific force
NORM_LEFT: Final = LOW_UP + 3  # variance of the norm that the bias does not explain
NORM_SUMS: Final = NORM_LEFT + 1  # weight, Σ n, Σ n², Σ u, Σ n u, Σ u uᵀ (upper triangle)
UNTRIED: Final = NORM_SUMS + 15  # time since a bias was last looked for

# Seven scalar measurements of an epoch: velocity, heading, rest. Of each 1/S (0: not taken) and y/S.
TAKEN: Final = UNTRIED + 1
HEADING_SLOPE: Final = TAKEN + 14  # derivatives of the heading with respect to tilt x, tilt y and delay
RAW: Final = HEADING_SLOPE + 3  # of each the variance of its noise, and what it misses the nominal values by
WIDENED: Final = RAW + 14  # whether the bias was given the variance of its miss before they were taken
N_TAKEN: Final = 32  # numbers from TAKEN to WIDENED
GAINS: Final = -(-(WIDENED + 1) // 8) * 8
ERROR: Final = GAINS + 7 * WIDTH
WORK: Final = ERROR + WIDTH
COV: Final = WORK + 6 * WIDTH
N_STATE: Final = COV + N * WIDTH


class Terms(NamedTuple):
    """The parameters as the kernel takes them: variances, spectral densities, times."""

    gyr: float
    scale: float
    walk: float
    velocity: float
    velocity_motion: float
    speed: float
    speed_motion: float
    motion_window: float
    acc_gate: float
    acc_share: float
    mag: float
    norm_gate: float
    dip_gate: float
    gate_power: float
    gate_window: float
    field_window: float
    field_new: float
    iron_share: float
    rest_gyr: float
    rest_acc: float
    rest_mean: float
    rest_window: float
    rest_speed: float
    rest_bias: float
    gyr_delay: float
    gravity: float
    epoch: float
    calibration_time: float
    matrix: float
    offset: float
    delay: float
    start_delay: float
    start_tilt: float
    start_heading: float
    start_bias: float
    inflation: float
    tilt_floor: float
    heading_floor: float
    time_floor: float

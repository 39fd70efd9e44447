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
CLIPPED: Final = 46  # time in which the gyroscope was at the end of its range
TURN: Final = 47  # Σ R dt by rows
SCALED: Final = 56  # Σ R r_k dt in motion, three matrices by rows, one after the other
REST_TURN: Final = 83  # Σ R dt at rest
FORCE: Final = 92  # Σ R a dt
N_MOVE: Final = 54  # numbers from TIME to FORCE
SHIFT: Final = 95  # Σ (R a + g) dt
FIELD_SUM: Final = 98
FIELD_SLOPE: Final = 101  # its derivative with respect to the delay
BLOCK: Final = 104  # the epoch's statistics, as `kernels.stillness` keeps them
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

# What the field says of iron on the body: sums, and what follows from them.
IRON: Final = BLOCKS + N_BLOCKS * N_BLOCK
IRON_TURN: Final = IRON + 16  # heading by which it would turn the field on average
IRON_KNOWN: Final = IRON_TURN + 1  # part of the variance of that heading that is no longer open

# Seven scalar measurements of an epoch: velocity, heading, rest. Of each 1/S (0: not taken) and y/S.
TAKEN: Final = IRON_KNOWN + 1
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
    mag: float
    norm_gate: float
    dip_gate: float
    gate_power: float
    gate_window: float
    field_window: float
    field_new: float
    rest_gyr: float
    rest_acc: float
    rest_mean: float
    rest_window: float
    rest_speed: float
    rest_bias: float
    gyr_range: float
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

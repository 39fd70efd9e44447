"""Errors of known sensors, as delivered; `SensorErrors.calibrated` gives them after calibration.

All figures are typical values at room temperature as their makers' data sheets state them, tolerances taken as
standard deviations; a single part may be several times better or worse. Temperature and ageing are not simulated.
What a sheet leaves open and a simulation needs is marked *assumed*: mostly the in-run bias stability of consumer
parts, of which 10 °/h and 40 µg are usual sizes.
"""

from __future__ import annotations

import math
from typing import Final

from northdown._validation import check_choice
from northdown.simulation.datasheet import accelerometer, gyroscope, magnetometer
from northdown.simulation.imu_errors import SensorErrors, TriadErrors
from northdown.simulation.motion import STANDARD_GRAVITY

_DEG: Final = math.pi / 180.0

LOW_COST: Final = SensorErrors(
    gyr=TriadErrors(noise=1.75e-4, bias=5e-3),
    acc=TriadErrors(noise=3e-3, bias=0.03),
    mag=TriadErrors(noise=0.06, bias=0.5),
)
"""A common MEMS part after calibration: N 0.01 °/s/√Hz, 300 µg/√Hz, 0.6 µT at 100 Hz; bias 0.3 °/s, 3 mg, 0.5 µT."""


def _k06(acc_bias_ug: float, gyr_bias_deg_h: float, acc_psd: float, gyr_psd: float) -> SensorErrors:
    # The table's densities are squares, (µg)²/Hz and (°/s)²/Hz, taken as N². Its magnetometer is that of chapter 4.
    return SensorErrors(
        gyr=TriadErrors(noise=math.sqrt(gyr_psd) * _DEG, bias=gyr_bias_deg_h * _DEG / 3600.0),
        acc=TriadErrors(
            noise=math.sqrt(acc_psd) * 1e-6 * STANDARD_GRAVITY, bias=acc_bias_ug * 1e-6 * STANDARD_GRAVITY
        ),
        mag=TriadErrors(noise=1.0 / math.sqrt(400.0)),
    )


K06_HIGH: Final = _k06(50.0, 0.01, 100.0, 1e-9)
"""K06 table 4.1, high quality: its limits, bias 50 µg and 0.01 °/h, noise 100 (µg)²/Hz and 1e-9 (°/s)²/Hz."""

K06_MEDIUM: Final = _k06(350.0, 0.3, 2500.0, 1e-6)
"""K06 table 4.1, medium quality: bias 200 to 500 µg and 0.1 to 1 °/h, noise 2500 (µg)²/Hz and 1e-6 (°/s)²/Hz."""

K06_LOW: Final = _k06(1000.0, 10.0, 10_000.0, 1e-5)
"""K06 table 4.1, low: bias from 1000 µg and 10 °/h; noise only stated as above medium, here 4 and 10 times."""

K06_CHAPTER_4: Final = SensorErrors(
    gyr=None, acc=TriadErrors(noise=0.1 / math.sqrt(400.0)), mag=TriadErrors(noise=1.0 / math.sqrt(400.0))
)
"""K06 chapter 4: noise 0.1 m/s² and 0.01 gauss at 400 Hz; no gyroscope."""

L3G4200D: Final = gyroscope(
    noise_density_deg=0.03,
    bias_stability_deg=20.0,  # assumed
    bias_deg=10.0,
    scale_percent=1.0,  # assumed; the sheet gives its change with temperature, 2 %
    cross_axis_percent=1.0,  # assumed
    range_deg=250.0,
    lsb_deg=8.75e-3,
)
"""STMicroelectronics L3G4200D gyroscope at ±250 °/s (data sheet 17116): 0.03 °/s/√Hz, zero-rate level ±10 °/s."""

ADXL345: Final = accelerometer(
    # 0.75 LSB rms in x and y, 1.1 in z, within 50 Hz; the sheet's 290 and 430 µg/√Hz are Allan deviations, so N
    noise_density_ug=[414.0, 414.0, 607.0],
    bias_stability_ug=50.0,  # assumed
    bias_mg=[35.0, 35.0, 40.0],
    scale_percent=1.0,
    cross_axis_percent=1.0,
    range_g=16.0,
    lsb_mg=3.9,
)
"""Analog Devices ADXL345 at full resolution, ±16 g (data sheet): 0.75 to 1.1 LSB rms at 100 Hz; ±35 mg."""

HMC5883L: Final = magnetometer(
    noise_rms_ut=0.2,
    rate=75.0,
    bias_ut=5.0,  # assumed, of the circuit board
    scale_percent=5.0,
    cross_axis_percent=0.2,
    range_ut=130.0,
    lsb_ut=0.092,
)
"""Honeywell HMC5883L magnetometer at ±1.3 gauss, 75 Hz (data sheet): 2 milligauss rms, 0.92 milligauss per LSB."""

J14: Final = SensorErrors(
    gyr=L3G4200D,
    acc=ADXL345,
    mag=magnetometer(
        noise_rms_ut=0.2,
        rate=50.0,
        bias_ut=5.0,
        scale_percent=5.0,
        cross_axis_percent=0.2,
        range_ut=130.0,
        lsb_ut=0.092,
    ),
)
"""J14's board: L3G4200D, ADXL345 and HMC5883L, the last one at 50 Hz."""

MPU_9250: Final = SensorErrors(
    gyr=gyroscope(
        noise_density_deg=0.01,
        bias_stability_deg=10.0,  # assumed
        bias_deg=5.0,
        scale_percent=3.0,
        cross_axis_percent=2.0,
        g_sensitivity_deg=0.1,  # assumed
        range_deg=500.0,
        lsb_deg=1.0 / 65.5,
    ),
    acc=accelerometer(
        noise_density_ug=300.0,
        bias_stability_ug=40.0,  # assumed
        bias_mg=[60.0, 60.0, 80.0],
        scale_percent=3.0,
        cross_axis_percent=2.0,
        range_g=8.0,
        lsb_mg=1000.0 / 4096.0,
    ),
    mag=magnetometer(
        noise_rms_ut=0.5,  # assumed
        rate=100.0,
        bias_ut=25.0,  # assumed
        scale_percent=5.0,
        cross_axis_percent=2.0,  # assumed
        range_ut=4912.0,
        lsb_ut=0.15,
    ),
)
"""InvenSense MPU-9250 at ±500 °/s and ±8 g (PS-MPU-9250A-01): 0.01 °/s/√Hz, ±5 °/s; 300 µg/√Hz; 0.15 µT per LSB."""

ICM_20948: Final = SensorErrors(
    gyr=gyroscope(
        noise_density_deg=0.015,
        bias_stability_deg=10.0,  # assumed
        bias_deg=5.0,
        scale_percent=1.5,
        cross_axis_percent=2.0,
        g_sensitivity_deg=0.1,  # assumed
        range_deg=500.0,
        lsb_deg=1.0 / 65.5,
    ),
    acc=accelerometer(
        noise_density_ug=230.0,
        bias_stability_ug=40.0,  # assumed
        bias_mg=50.0,
        scale_percent=0.5,
        cross_axis_percent=2.0,
        range_g=8.0,
        lsb_mg=1000.0 / 4096.0,
    ),
    mag=magnetometer(
        noise_rms_ut=0.5,  # assumed
        rate=100.0,
        bias_ut=25.0,  # assumed; the sheet allows ±300 µT
        scale_percent=5.0,  # assumed
        cross_axis_percent=2.0,  # assumed
        range_ut=4900.0,
        lsb_ut=0.15,
    ),
)
"""TDK InvenSense ICM-20948 at ±500 °/s and ±8 g (DS-000189): 0.015 °/s/√Hz, ±5 °/s; 230 µg/√Hz, ±50 mg on a board."""

BMI088: Final = SensorErrors(
    gyr=gyroscope(
        noise_density_deg=0.014,
        bias_stability_deg=2.0,
        bias_deg=1.0,
        scale_percent=1.0,
        cross_axis_percent=1.0,
        g_sensitivity_deg=0.1,
        range_deg=500.0,
        lsb_deg=1.0 / 65.536,
    ),
    acc=accelerometer(
        noise_density_ug=[160.0, 160.0, 190.0],
        bias_stability_ug=30.0,  # assumed
        bias_mg=20.0,
        scale_percent=0.5,  # assumed
        cross_axis_percent=0.5,
        range_g=6.0,
        lsb_mg=1000.0 / 5460.0,
    ),
    mag=None,
)
"""Bosch BMI088 at ±500 °/s and ±6 g (BST-BMI088-DS001): 0.014 °/s/√Hz, below 2 °/h, ±1 °/s; 160 to 190 µg/√Hz."""

LSM6DSO: Final = SensorErrors(
    gyr=gyroscope(
        noise_density_deg=0.0038,
        bias_stability_deg=4.0,  # assumed
        bias_deg=1.0,
        scale_percent=1.0,
        cross_axis_percent=1.0,  # assumed
        range_deg=500.0,
        lsb_deg=0.0175,
    ),
    acc=accelerometer(
        noise_density_ug=70.0,
        bias_stability_ug=30.0,  # assumed
        bias_mg=20.0,
        scale_percent=1.0,
        cross_axis_percent=1.0,  # assumed
        range_g=4.0,
        lsb_mg=0.122,
    ),
    mag=None,
)
"""STMicroelectronics LSM6DSO at ±500 °/s and ±4 g, high performance (DS12140): 3.8 m°/s/√Hz, ±1 °/s; 70 µg/√Hz."""

ADIS16470: Final = SensorErrors(
    gyr=gyroscope(
        angle_random_walk_deg=0.34,
        bias_stability_deg=8.0,
        bias_deg=0.2,
        scale_percent=0.5,  # assumed
        cross_axis_percent=0.09,  # 0.05° between axes
        g_sensitivity_deg=0.015,
        range_deg=2000.0,
        lsb_deg=1.0 / 655_360.0,
    ),
    acc=accelerometer(
        velocity_random_walk=0.037,
        bias_stability_ug=13.0,
        bias_mg=2.0,  # assumed
        scale_percent=0.5,  # assumed
        cross_axis_percent=0.09,
        range_g=40.0,
        lsb_mg=1000.0 / 52_428_800.0,
    ),
    mag=None,
)
"""Analog Devices ADIS16470, 32-bit samples (data sheet): 0.34 °/√h, 8 °/h, 0.2 °/s; 0.037 m/s/√h, 13 µg."""

PRESETS: Final[dict[str, SensorErrors]] = {
    "perfect": SensorErrors(),
    "low-cost": LOW_COST,
    "k06-high": K06_HIGH,
    "k06-medium": K06_MEDIUM,
    "k06-low": K06_LOW,
    "k06-chapter-4": K06_CHAPTER_4,
    "j14": J14,
    "mpu-9250": MPU_9250,
    "icm-20948": ICM_20948,
    "bmi088": BMI088,
    "lsm6dso": LSM6DSO,
    "adis16470": ADIS16470,
}
"""Sensors by name."""


def preset(name: str) -> SensorErrors:
    """Sensors of a name in `PRESETS`."""
    return PRESETS[check_choice("preset", name, tuple(PRESETS))]

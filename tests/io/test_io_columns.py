"""Recognition of columns by the headers of real loggers, and refusal of what is doubtful."""

from __future__ import annotations

import pytest

from northdown.io.columns import plan_columns

GYR = {"gyr": (0, 1, 2)}


def triple(pattern: str) -> list[str]:
    return [pattern.replace("#", axis) for axis in "xyz"]


@pytest.mark.parametrize(
    ("role", "pattern", "unit"),
    [
        ("gyr", "gyr_#", None),
        ("gyr", "Gyroscope # (deg/s)", "deg/s"),
        ("gyr", "gyro# (dps)", "dps"),
        ("gyr", "angular_velocity.#", None),
        ("gyr", "field.angular_velocity.#", None),
        ("gyr", "w_RS_S_# [rad s^-1]", "rad s^-1"),
        ("gyr", "g#", None),
        ("gyr", "w#_dps", "dps"),
        ("gyr", "imu_gyr_#", None),
        ("acc", "acc_#_g", "g"),
        ("acc", "Accelerometer # (g)", "g"),
        ("acc", "linear_acceleration_#", None),
        ("acc", "a_RS_S_# [m s^-2]", "m s^-2"),
        ("acc", "a#", None),
        ("acc", "accel#", None),
        ("acc", "#acc", None),
        ("acc", "acc_#_m/s^2", "m/s^2"),
        ("mag", "mag_#", None),
        ("mag", "Magnetometer # (µT)", "µT"),
        ("mag", "m#_mG", "mG"),
        ("mag", "magnetic_field_#", None),
    ],
)
def test_sensor(role: str, pattern: str, unit: str | None) -> None:
    for labels in (
        triple(pattern),
        [s.upper().replace("DPS", "dps") for s in triple(pattern)] if "_" in pattern else [],
    ):
        if labels:
            plan = plan_columns(labels)
            assert plan.places == {role: (0, 1, 2)}
            assert (plan.units.get(role) or "").lower() == (unit or "").lower()


def test_camel_case() -> None:
    assert plan_columns(["gyroX", "gyroY", "gyroZ"]).places == GYR
    assert plan_columns(["AccX", "AccY", "AccZ"]).places == {"acc": (0, 1, 2)}
    phone = [f"motionRotationRate{c}(rad/s)" for c in "XYZ"] + [f"motionUserAcceleration{c}(G)" for c in "XYZ"]
    assert plan_columns(phone).places == GYR  # acceleration without gravity is not what an accelerometer says


@pytest.mark.parametrize(
    ("label", "unit"),
    [("time", None), ("Time (s)", "s"), ("timestamp [ns]", "ns"), ("t", None), ("time_ms", "ms"), ("t_us", "us")],
)
def test_time(label: str, unit: str | None) -> None:
    plan = plan_columns([label, *triple("gyr_#")])
    assert plan.places["time"] == (0,)
    assert plan.units.get("time") == unit


@pytest.mark.parametrize(
    "pattern", ["ref_q#", "quat_#", "q#", "Vicon Orientation #", "reference_quaternion_#", "q_RS_# []"]
)
def test_reference(pattern: str) -> None:
    labels = [pattern.replace("#", c) for c in "xyzw"]
    assert plan_columns([*labels, *triple("acc_#")]).places["reference"] == (3, 0, 1, 2)


@pytest.mark.parametrize(
    "pattern",
    [
        "gyr_bias_#",
        "b_w_RS_S_# [rad s^-1]",
        "FreeAcc_#",
        "motion User Acceleration # (G)",
        "angular_velocity_covariance_#",
        "vel_#",
        "opt_pos_#",
        "gravity_#",
    ],
)
def test_other_quantities_are_left_alone(pattern: str) -> None:
    assert plan_columns([*triple("mag_#"), *triple(pattern)]).places == {"mag": (0, 1, 2)}


def test_attitude_of_a_ros_message_is_no_reference() -> None:
    labels = [f"field.orientation.{c}" for c in "xyzw"]
    assert "reference" not in plan_columns([*labels, *triple("acc_#")]).places


def test_plainest_name_wins() -> None:
    assert plan_columns([*triple("acc_raw_#"), *triple("acc_#")]).places == {"acc": (3, 4, 5)}


def test_order_of_axes_is_by_name() -> None:
    assert plan_columns(["gyr_z", "gyr_x", "gyr_y"]).places == {"gyr": (1, 2, 0)}


def test_doubtful_names(refused) -> None:
    labels = [*triple("imu1_acc_#"), *triple("acc_#"), *triple("Acc #")]
    refused(lambda: plan_columns(labels), "one column for acc x", "'acc_x' and 'Acc x'", "columns={'acc'")


def test_missing_axis(refused) -> None:
    refused(lambda: plan_columns(["gyr_x", "gyr_y"]), "columns x, y, z of gyr", "'gyr_x', 'gyr_y'")


def test_different_units(refused) -> None:
    refused(lambda: plan_columns(["gyr_x (deg/s)", "gyr_y (deg/s)", "gyr_z (rad/s)"]), "one unit for the axes of gyr")


def test_unknown_unit_of_a_needed_column(refused) -> None:
    refused(lambda: plan_columns(triple("gyr_# (counts)")), "a unit of gyr", "'counts'", "units={'gyr'")
    assert plan_columns(triple("gyr_# (counts)"), units={"gyr": 0.001}).units == {"gyr": 0.001}


def test_unknown_unit_of_an_unneeded_column() -> None:
    assert plan_columns([*triple("gyr_#"), "temperature (furlong)"]).places == GYR


def test_nothing_found(refused) -> None:
    refused(lambda: plan_columns(["a", "b\nc", "d"]), "'a', 'b\\nc', 'd'", "columns={")


def test_columns_by_name_and_number() -> None:
    labels = ["p (dps)", "q (dps)", "r (dps)", "u", "v", "w"]
    plan = plan_columns(labels, columns={"gyr": ["p", "q", "r"], "acc": [3, 4, 5]})
    assert plan.places == {"gyr": (0, 1, 2), "acc": (3, 4, 5)}
    assert plan.units == {"gyr": "dps"}


def test_empty_columns_leave_out() -> None:
    assert plan_columns([*triple("gyr_#"), *triple("mag_#")], columns={"mag": []}).places == GYR


@pytest.mark.parametrize(
    ("columns", "part"),
    [
        ({"gyr": ["gyr_x", "gyr_y", "gyr_q"]}, "did you mean 'gyr_"),
        ({"gyr": ["gyr_x"]}, "3 columns for gyr"),
        ({"gyro": ["gyr_x"]}, "columns of time, gyr"),
        ({"gyr": [0, 1, 99]}, "from 0 to 2"),
        ({"gyr": [0, 1, -1]}, "from 0 to 2"),
        ({"gyr": [0, 1, 1.5]}, "name or number"),
    ],
)
def test_wrong_columns(columns, part, refused) -> None:
    refused(lambda: plan_columns(triple("gyr_#"), columns=columns), part)


def test_units_for_unknown_quantity(refused) -> None:
    refused(lambda: plan_columns(triple("gyr_#"), units={"gyro": "dps"}), "units of time, gyr, acc, mag")

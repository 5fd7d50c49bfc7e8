"""Check of the numbers of a vehicle's description that the simulated plant reads."""

import numpy as np

from uam_control.settings.section import Section

# entries that only the description and what is made of it read; a change of them has no effect
NOT_OF_THE_PLANT = (
    *("model", "profiles", "autopilot", "control_period", "mass", "gravity", "joints", "arm"),
    *("end_effector", "gripper.kind", "gripper.type", "gripper.model", "gripper.body"),
    *("gripper.instead_of", "gripper.position", "gripper.mass", "gripper.friction"),
    "gripper.grip_depth",
    *("rotors.layout", "rotors.radius", "rotors.moment_ratio"),
    *("servos.effort_limit", "servos.load_friction"),
)

LEAST_RATE, LARGEST_RATE = 30.0, 360.0  # [Hz] of poses with which the estimator is made to fly


def check_plant_numbers(top: Section, servos: list[Section]) -> None:
    """Raise the section's error if an entry that only plant or drivers read is not usable.

    servos: those of each joint.
    """
    air = top.section("air")
    if min(drag := air.numbers("drag", 3)) < 0.0:
        raise air.error("drag", f"{min(drag):g} N s/m is below 0")
    air.numbers("wind", 3)
    air.not_negative("gust")
    air.positive("gust_time")
    sensors = top.section("sensors")
    sensors.not_negative("noise_scale")
    mocap, imu, joints = (sensors.section(name) for name in ("mocap", "imu", "joints"))
    rate = mocap.number("rate")
    if not LEAST_RATE <= rate <= LARGEST_RATE:
        allowed = f"{LEAST_RATE:g} to {LARGEST_RATE:g} Hz"
        raise mocap.error("rate", f"{rate:g} Hz; allowed: {allowed}")
    joints.positive("counts_per_turn")
    joints.positive("velocity_unit")
    for name in ("position_noise", "attitude_noise"):
        mocap.not_negative(name)
    for name in ("gyro_noise", "gyro_bias", "accelerometer_noise", "accelerometer_bias"):
        imu.not_negative(name)
    if mocap.has("payload"):
        mocap.switch("payload")
    for sensor in (mocap, imu, joints):
        sensor.whole("latency_ticks")
    for servo in servos:
        servo.whole("command_latency_ticks")
        if servo.has("load_friction"):
            servo.not_negative("load_friction")
        for name in filter(servo.has, ("torque_per_current", "current_unit")):
            servo.positive(name)
    variation = top.section("variation")
    for name in ("mass", "inertia"):
        variation.positive(name)
    variation.numbers("payload_offset", 2)
    if variation.has("base_offset"):
        variation.numbers("base_offset", 3 if len(variation.entry("base_offset")) == 3 else 2)
    if variation.has("tip_mass"):
        variation.not_negative("tip_mass")
    if not top.has("magnet"):
        return
    magnet = top.section("magnet")
    magnet.positive("holding_force")
    magnet.positive("gap_scale")
    if magnet.has("curve"):
        check_curve(magnet)


def check_curve(magnet: Section) -> None:
    """Raise the section's error if `curve` is no list of [gap [m], fraction 0..1], by gap."""
    curve = magnet.entry("curve")
    try:
        points = np.array(curve, dtype=float) if curve else np.zeros((0, 2))
    except (TypeError, ValueError):
        points = np.full((1, 2), np.nan)
    usable = points.ndim == 2 and points.shape[1] == 2 and np.all(points >= 0.0)
    if not usable or np.any(np.diff(points[:, 0]) <= 0.0) or np.any(points[:, 1] > 1.0):
        allowed = "[[gap in m, fraction 0 to 1], ...] by growing gaps"
        raise magnet.error("curve", f"{curve}; allowed: {allowed}")

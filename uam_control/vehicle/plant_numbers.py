"""Check of the numbers of a vehicle's description that the simulated plant reads."""

from __future__ import annotations

from uam_control.settings.section import Section

# entries that only the description and what is made of it read; a change of them has no effect
NOT_OF_THE_PLANT = (
    *("model", "profiles", "autopilot", "control_period", "mass", "gravity", "joints", "arm"),
    *("rotors.layout", "rotors.radius", "rotors.moment_ratio", "servos.effort_limit"),
)


def check_plant_numbers(top: Section) -> None:
    """Raise the section's error if an entry that only plant or drivers read is not usable."""
    air = top.section("air")
    air.numbers("drag", 3)
    air.numbers("wind", 3)
    air.not_negative("gust")
    air.positive("gust_time")
    sensors = top.section("sensors")
    sensors.not_negative("noise_scale")
    mocap, imu, joints = (sensors.section(name) for name in ("mocap", "imu", "joints"))
    mocap.positive("rate")
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
    servos = top.section("servos")
    servos.whole("command_latency_ticks")
    for name in filter(servos.has, ("torque_per_current", "current_unit")):
        servos.positive(name)
    variation = top.section("variation")
    for name in ("mass", "inertia"):
        variation.positive(name)
    variation.numbers("payload_offset", 2)
    if variation.has("base_offset"):
        variation.numbers("base_offset", 2)
    if variation.has("tip_mass"):
        variation.not_negative("tip_mass")
    magnet = top.section("magnet")
    magnet.positive("holding_force")
    magnet.positive("gap_scale")

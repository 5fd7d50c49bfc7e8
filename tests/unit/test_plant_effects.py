"""The effects of a laboratory on the plant: each by hand, and what they leave alone."""

import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.faulty_plant import make_plant
from uam_sim_bridge.mavlink.transport.faulty_transport import LateTransport
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.acting_effects import generator
from uam_sim_bridge.plant.effects.arm_occlusion import distance, hide, seen_markers, shift_pose
from uam_sim_bridge.plant.effects.battery_sag import discharge
from uam_sim_bridge.plant.effects.catalogue import EFFECTS
from uam_sim_bridge.plant.effects.downwash import momentum
from uam_sim_bridge.plant.effects.effect import Acting, Effect, size
from uam_sim_bridge.plant.effects.ground_effect import raise_thrust, thrust_ratio
from uam_sim_bridge.plant.effects.joint_gear import Gear, followed, gear_step, rigid_step
from uam_sim_bridge.plant.effects.mocap_dropouts import drop
from uam_sim_bridge.plant.effects.mocap_jitter import jitter
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay
from uam_sim_bridge.plant.effects.odometry_drift import express, jump
from uam_sim_bridge.plant.effects.propeller_vibration import Shaken, mean_of_wave, vibrate
from uam_sim_bridge.plant.engines import PlantError
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

LEVEL = np.eye(3).ravel()
SENSING = ("propeller_vibration", "mocap_jitter", "mocap_dropouts", "arm_occlusion")
MOCAP = ("mocap_jitter", "mocap_dropouts", "arm_occlusion")


def plant(*specs, seed=1, vehicle="s500_arm", payload=0.2):
    effects = presets.read((), specs)
    return MujocoPlant(Vehicle.load(vehicle).changed({"effects": effects}), payload, seed)


def flown(one, ticks=60, command=0.6):
    """Return the samples and the true states of some ticks with constant commands."""
    rotors, samples, states = len(one.vehicle.description.rotors), [], []
    for tick in range(ticks):
        samples.append(one.sense())
        states.append(one.truth().state)
        one.step(np.full(rotors, command), np.full(one.joints, 0.3 * math.sin(tick)), False)
    return samples, np.array(states)


def tick(one, name):
    """Let one effect act before a control period."""
    acting = one.effects.acting[name]
    one.effects.draw()
    acting.steps["tick"](acting.arrays)


def column(samples, kind):
    return [s and np.concatenate([np.atleast_1d(x) for x in s]) for s in map(kind, samples)]


def same(a, b):
    return len(a) == len(b) and all(
        (x is None and y is None) or (x is not None and y is not None and np.array_equal(x, y))
        for x, y in zip(a, b, strict=True)
    )


# Presets


def test_calm_has_no_effects_and_laboratory_has_all_but_an_odometry():
    assert presets.read() == presets.read(["calm"]) == {}
    assert set(presets.read(["laboratory"])) == set(EFFECTS) - {"odometry_drift"}
    assert set(presets.read(["odometry"])) == {"odometry_drift", "mocap_feed"}


def test_every_effect_names_its_source_and_describes_its_numbers():
    for kind in EFFECTS.values():
        assert len(kind.SOURCE) > 20 and len(kind.ABOUT) > 20
        assert all(spec.description and spec.unit for _, spec in kind.ranges())


@given(st.permutations(sorted(EFFECTS)))
@settings(max_examples=5)
def test_all_effects_switched_off_are_the_calm_plant(names):
    assert presets.read(["laboratory"], [f"{name}=off" for name in names]) == {}


@given(seed=st.integers(0, 1000), command=st.floats(0.0, 1.0))
@settings(max_examples=4, deadline=None)
def test_without_effects_the_plant_is_calm_bit_for_bit(seed, command):
    off = presets.read(["laboratory", "calm"], [f"{name}=off" for name in EFFECTS])
    calm = MujocoPlant(Vehicle.load(), 0.2, seed)
    same_plant = MujocoPlant(Vehicle.load().changed({"effects": off}), 0.2, seed)
    (samples, states), (others, other_states) = (
        flown(calm, 30, command),
        flown(same_plant, 30, command),
    )
    assert np.array_equal(states, other_states)
    assert same(column(samples, lambda s: s.hil), column(others, lambda s: s.hil))


def test_a_later_file_overrides_and_the_rest_is_from_the_laboratory(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("downwash: {drag: 2.0}\njoint_gear: off\nground_effect: on\n")
    mine = presets.read([str(file)])
    assert set(mine) == {"downwash", "ground_effect"}
    assert mine["downwash"] == presets.laboratory()["downwash"] | {"drag": 2.0}
    both = presets.read(["laboratory", str(file)], ["downwash:drag=3,spreading=0.2"])
    assert "joint_gear" not in both and both["downwash"]["drag"] == 3.0
    assert both["downwash"]["spreading"] == 0.2


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("earthquake", "unknown effect 'earthquake'; there are: propeller_vibration"),
        ("downwash:weight=1", "weight: unknown; allowed: spreading"),
        ("downwash:drag=9", "drag: 9.0 is outside 0 to 3"),
        ("downwash:drag=much", "'much' is not a number"),
        ("downwash=maybe", "NAME=off"),
    ],
)
def test_a_bad_switch_is_refused_in_one_line(spec, words):
    with pytest.raises(PlantError) as refused:
        presets.read((), [spec])
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_a_plant_without_effects_refuses_them():
    vehicle = Vehicle.load().changed({"effects": presets.read(["laboratory"])})
    with pytest.raises(PlantError, match="preset calm only"):
        make_plant(vehicle, 0.0, 1, (), Schedule(), "tests.rigid_body_plant:RigidBodyPlant")


# All together


@pytest.mark.parametrize("vehicle", ["s500_arm", "hexa_arm", "s500_arm3"])
def test_a_seed_gives_the_same_laboratory_on_every_vehicle(vehicle):
    runs = [flown(plant(*EFFECTS, seed=seed, vehicle=vehicle)) for seed in (1, 1, 2)]
    for kind in (lambda s: s.hil, lambda s: s.mocap, lambda s: s.joints):
        assert same(column(runs[0][0], kind), column(runs[1][0], kind))
    assert np.array_equal(runs[0][1], runs[1][1])
    assert not np.array_equal(runs[0][1], runs[2][1])
    assert np.all(np.isfinite(runs[0][1]))


def test_the_draws_of_an_effect_do_not_depend_on_the_others():
    assert np.array_equal(
        generator(3, "downwash").standard_normal(3), generator(3, "downwash").standard_normal(3)
    )
    alone, together = plant("rotor_spread"), plant("rotor_spread", "mocap_dropouts", "downwash")
    assert np.array_equal(alone.rotors.efficiency, together.rotors.efficiency)


@pytest.mark.parametrize("name", SENSING)
def test_effects_of_the_sensors_leave_the_motion_alone(name):
    assert np.array_equal(flown(plant())[1], flown(plant(name))[1])


@pytest.mark.parametrize("name", MOCAP)
def test_effects_of_the_mocap_leave_the_imu_alone(name):
    calm, changed = flown(plant())[0], flown(plant(name))[0]
    assert same(column(calm, lambda s: s.hil), column(changed, lambda s: s.hil))


# Propellers


def test_the_mean_of_a_wave_over_whole_turns_is_zero_and_over_none_its_value():
    cosine, sine = mean_of_wave(0.7, 4.0 * math.pi)
    assert cosine == pytest.approx(0.0, abs=1e-15) and sine == pytest.approx(0.0, abs=1e-15)
    assert mean_of_wave(0.7, 0.0) == (math.cos(0.7), math.sin(0.7))


def test_an_unbalanced_rotor_shakes_the_imu_by_hand():
    # 500 rad/s for 4 ms: 2 rad; mean of cos: sin(2)/2 = 0.45465, of sin: (1 - cos 2)/2 = 0.70807
    sample, phases = np.zeros(6), np.zeros(1)
    shaken = Shaken(
        sample, np.array([500.0]), np.ones(1), np.array([[0.0, 0.0, 0.05]]), phases,
        np.array([1e-6]), 0.0, 1.0 / 2.0, np.full(3, 1.0 / 0.02), 0.004,
    )  # fmt: skip
    vibrate(shaken)
    gyro, force = sample[:3], sample[3:]
    push = 1e-6 * 500.0**2  # 0.25 N
    assert force == pytest.approx([0.45465 * push / 2, 0.70807 * push / 2, 0.0], abs=1e-6)
    # torque 0.05 m x F about y from the x force, about -x from the y force; integrated: / omega
    turn = 0.05 * push / 500.0 / 0.02
    assert gyro == pytest.approx([0.45465 * turn, 0.70807 * turn, 0.0], abs=1e-8)
    assert phases == pytest.approx([2.0])


def test_vibration_needs_turning_rotors_and_has_the_size_that_the_preset_states():
    still, hover = plant("propeller_vibration"), plant("propeller_vibration")
    bare, shaken = flown(plant(), 300, 0.0)[0], flown(still, 300, 0.0)[0]
    assert same(column(bare, lambda s: s.hil), column(shaken, lambda s: s.hil))
    bare, shaken = flown(plant(), 300, 0.45)[0], flown(hover, 300, 0.45)[0]
    added = np.array([a.hil[2] - b.hil[2] for a, b in zip(shaken, bare, strict=True)])[100:]
    assert 0.5 < np.sqrt(np.mean(added[:, :2] ** 2)) < 2.0  # about 1 m/s^2 RMS


def test_rotors_differ_but_not_wildly_and_lags_with_them():
    one, calm = plant("rotor_spread", seed=4), plant(seed=4)
    drawn = generator(4, "rotor_spread").standard_normal((2, 4))
    assert one.rotors.efficiency == pytest.approx(1.0 + 0.03 * np.clip(drawn[0], -2.5, 2.5))
    lag = 0.0125 * (1.0 + 0.10 * np.clip(drawn[1], -2.5, 2.5))
    assert one.rotors.gains[0] == pytest.approx(1.0 - np.exp(-0.002 / lag))
    assert np.array_equal(calm.rotors.efficiency, np.ones(4))


# Battery


def test_the_battery_sags_by_charge_and_current_by_hand():
    one = plant("battery_sag:start=1", payload=0.0)
    battery = one.effects.acting["battery_sag"].arrays
    one.rotors.thrust[:] = 5.4
    # ideal power 5.4^1.5 / sqrt(2 1.2 pi 0.127^2) = 35.98 W per rotor; 4 / 0.6 of it and 20 W
    power = 4 * 35.98 / 0.6 + 20.0
    discharge(battery)
    assert one.rotors.constants[1] == pytest.approx(8.549e-6 * 1100.0**2)  # full, no current yet
    gain = 1.0 - math.exp(-0.004 / 0.1)
    assert battery.numbers["current"] == pytest.approx(gain * power / 16.2, rel=1e-3)
    battery.numbers["current"] = 16.0
    discharge(battery)
    sag = (16.2 - 4 * 0.005 * 16.0) / 16.2  # 0.98025
    assert one.rotors.constants[1] == pytest.approx(8.549e-6 * 1100.0**2 * sag**2, rel=1e-5)
    battery.numbers["charge"] = 0.0
    discharge(battery)
    assert one.rotors.constants[1] < 8.549e-6 * 1100.0**2 * (3.6 / 4.05) ** 2


# Air


def test_ground_effect_on_the_skids_by_hand():
    # R 0.127, d 0.342, b 0.4837 m; z 0.335 m: losses 0.00898, 0.01269, 0.00479, 0.03830
    shape = np.array([0.127, 0.342, 0.4837, 2.0, 1.0])
    assert thrust_ratio(0.335, shape) == pytest.approx(1.0 / (1.0 - 0.06476), abs=1e-4)
    assert thrust_ratio(3.0, shape) == pytest.approx(1.0, abs=0.003)
    assert thrust_ratio(0.0, shape) == thrust_ratio(0.0635, shape) < 2.5  # bounded


def test_each_rotor_has_the_ground_effect_of_its_own_height():
    shape, lift = np.array([0.127, 0.342, 0.4837, 2.0, 1.0]), np.ones(2)
    tilted = np.array([1.0, 0, 0, 0, 0.8, -0.6, 0, 0.6, 0.8])  # about x: the left rotor is higher
    raise_thrust(
        np.array([0.0, 0.0, 0.5]), tilted, np.array([[0, 0.2, 0], [0, -0.2, 0]]), shape, lift
    )
    assert lift == pytest.approx([thrust_ratio(0.62, shape), thrust_ratio(0.38, shape)])


def test_a_jet_begins_with_momentum_theory_and_keeps_its_momentum():
    rotor, thrust = np.zeros((1, 3)), np.array([5.4])
    down = np.array([0.0, 0.0, -1e-9])
    at_disc = momentum(down, LEVEL, rotor, thrust, 0.127, 0.1)
    assert at_disc == pytest.approx(2 * 5.4 / (1.2 * math.pi * 0.127**2), rel=1e-6)  # (2 v_i)^2
    for below in (0.2, 1.0):  # rho times the integral of u^2 over the plane is the thrust
        r = np.linspace(0.0, 3.0, 3001)
        u2 = [momentum(np.array([x, 0, -below]), LEVEL, rotor, thrust, 0.127, 0.1) for x in r]
        assert 1.2 * np.trapezoid(2 * math.pi * r * u2, r) == pytest.approx(5.4, rel=1e-3)
    assert momentum(np.array([0.0, 0.0, 0.1]), LEVEL, rotor, thrust, 0.127, 0.1) == 0.0  # above


def test_the_downwash_pushes_the_payload_down():
    one = plant("downwash:turbulence=0")
    payload = one.model.body("payload").id
    one.rotors.thrust[:] = 5.4
    one.data.xpos[payload] = one.data.xpos[one.model.body("base").id] + [0.17, 0.17, -0.3]
    tick(one, "downwash")
    force = one.data.xfrc_applied[payload]
    # below rotor 3: b = 0.1057 + 0.1 0.35 = 0.1407 m, u^2 = 100.5; half 1.2 1.05 0.0036 of it
    assert force[2] == pytest.approx(-0.5 * 1.2 * 1.05 * 0.0036 * 100.5, rel=0.02)
    assert force[0] == force[1] == 0.0


# Joints


def gear(torque, alpha, angle, speed=0.0, friction=0.1, alpha_dot=0.0, load=0.0):
    """One step of a gear of 0.02 rad half play, 100 N m/rad; return contact, angle, speed."""
    constants = np.array([0.02, 100.0, 0.0, 1.5, 0.05, 0.0, 0.002])
    angles, speeds, output = np.array([angle]), np.array([speed]), np.zeros(1)
    friction = np.array([friction]), np.array([load])
    motors = Gear(np.array([0.01]), *friction, constants, np.ones(1), angles, speeds)
    gear_step(motors, np.array([torque]), np.array([alpha]), np.array([alpha_dot]), output)
    return output[0], angles[0], speeds[0]


def test_teeth_of_a_light_joint_are_as_soft_as_the_physics_step_needs():
    """Motor 0.5, link 1.0 g m^2: (150 h^2 + 2 0.3 h) 3000 = 5.4 with h = 2 ms: 3 / 5.4.

    A light pair that is let go comes to rest; with all of them it does not.
    """
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.002"/><worldbody><body><joint armature="1e-3"/>'
        '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-12 1e-12 1e-12"/>'
        "</body></worldbody></mujoco>"
    )
    bench = SimpleNamespace(model=model, data=mujoco.MjData(model), arm_dofs=slice(0, 1))
    (teeth,) = followed(bench, np.array([0.5e-3]), 150.0, 0.3)
    assert teeth == pytest.approx(3.0 / 5.4, rel=1e-6)
    assert followed(bench, np.array([0.5e-3]), 15.0, 0.03)[0] == 1.0

    def swing(part):
        constants = np.array([0.0, 150.0, 0.3, 1.0, 0.05, 0.0, 0.002])
        state = np.zeros(1), np.zeros(1)
        motors = Gear(
            np.array([0.5e-3]), np.zeros(1), np.zeros(1), constants, np.array([part]), *state
        )
        angle, speed, output = np.array([0.01]), np.zeros(1), np.zeros(1)
        for _ in range(200):
            gear_step(motors, np.zeros(1), angle, speed, output)
            speed += 0.002 * output / 1e-3
            angle += 0.002 * speed
        return abs(speed[0])

    assert swing(teeth) < 0.05 < 1.0 < swing(1.0)


def test_inside_the_play_no_torque_and_beyond_it_a_spring():
    assert gear(0.0, 0.0, 0.019)[0] == 0.0
    assert gear(0.0, 0.0, 0.03)[0] == pytest.approx(1.0)  # 100 N m/rad * 0.01 rad
    assert gear(0.0, 0.0, -0.03)[0] == pytest.approx(-1.0)


def test_stiction_holds_a_resting_motor_and_coulomb_brakes_a_moving_one():
    assert gear(0.149, 0.0, 0.0)[2] == 0.0  # below 1.5 * 0.1 N m
    assert gear(0.16, 0.0, 0.0)[2] == pytest.approx((0.16 - 0.15) * 0.002 / 0.01)
    # at 1 rad/s the Stribeck excess is gone: 0.1 N m brakes
    assert gear(0.0, 0.0, 0.0, speed=1.0)[2] == pytest.approx(1.0 - 0.1 * 0.002 / 0.01)


def test_friction_grows_with_the_torque_of_the_servo():
    # at 1 rad/s: 0.1 + 0.3 2.0 = 0.7 N m brakes, 2.0 N m drives
    turned = gear(2.0, 0.0, 0.0, speed=1.0, load=0.3)[2]
    assert turned == pytest.approx(1.0 + (2.0 - 0.7) * 0.002 / 0.01)


@pytest.mark.parametrize(
    ("speed", "torque"),
    [
        (1.0, 2.0 - 0.7),  # tanh(1 / 0.015) = 1: all of 0.1 + 0.3 2.0
        (0.0, 2.0),  # at rest no friction: smooth
        (0.015, 2.0 - 0.01 * 0.015 / 0.002),  # tanh(1) 0.7 would turn it back: its momentum only
        (-1.0, 2.0 + 0.7),
    ],
)
def test_a_rigid_gear_has_smooth_friction_that_never_turns_the_joint_back(speed, torque):
    constants = np.array([0.0, 0.0, 0.0, 1.0, 0.05, 0.015, 0.002])
    own = np.array([0.01]), np.array([0.1]), np.array([0.3])
    torques = np.array([2.0])
    rigid_step(
        Gear(*own, constants, np.ones(1), np.zeros(1), np.zeros(1)), torques, np.array([speed])
    )
    assert torques[0] == pytest.approx(torque)


def test_a_joint_with_play_swings_freely_within_it():
    one = plant("joint_gear:backlash_deg=2")
    for _ in range(250):
        one.sense()
        one.step(np.zeros(4), np.array([0.0, 0.0]), False)
    motors = one.effects.acting["joint_gear"].arrays[0]
    gap = np.abs(motors.angle - one.truth().state[0, 6:])
    assert np.all(gap <= math.radians(1.0) + 0.01)


def test_cables_pull_to_their_rest_angle():
    one = plant("cable_torque:stiffness=0.02,stiffness_spread=0,rest_spread_deg=0")
    bench = one.effects.bench
    bench.angles[:] = [0.5, math.radians(90.0) - 0.25]
    tick(one, "cable_torque")
    assert one.data.qfrc_applied[bench.arm_dofs] == pytest.approx([-0.01, 0.005])


def test_the_current_loop_s_noise_has_its_size_and_bandwidth_at_every_joint():
    one = plant("servo_noise:torque=0.02/0.01,bandwidth=5")
    noise, states = one.effects.acting["servo_noise"], []
    for _ in range(20000):
        tick(one, "servo_noise")
        states.append(noise.arrays.noise.copy())
    states = np.array(states)
    assert states.std(axis=0) == pytest.approx([0.02, 0.01], rel=0.1)
    kept = [np.corrcoef(column[1:], column[:-1])[0, 1] for column in states.T]
    assert kept == pytest.approx([math.exp(-2.0 * math.pi * 5.0 * 0.004)] * 2, abs=0.01)


def test_a_number_for_each_joint_must_fit_the_vehicle():
    with pytest.raises(
        PlantError, match="3 numbers; allowed: one, or one for each of the 2 joints"
    ):
        plant("servo_noise:torque=0.1/0.1/0.1")


def test_speeds_are_reported_late_and_angles_at_once():
    late, calm = plant("joint_readings:delay=0.04"), plant()
    (found, _), (usual, _) = flown(late), flown(calm)
    for k in range(10, 60):
        assert np.array_equal(found[k].joints[2], usual[k - 10].joints[2] if k > 10 else [0, 0])
        assert np.array_equal(found[k].joints[1], usual[k].joints[1])


# Rotors, masses and loads that are not the vehicle file's


def test_rotors_differ_from_the_file_by_the_factors():
    one = plant("rotor_mismatch:thrust=1/1/0.9/1,yaw=0.5,lag_up=2,lag_down=1,idle=0.1")
    assert one.rotors.efficiency == pytest.approx([1.0, 1.0, 0.9, 1.0])
    assert one.rotors.gains[:, 0] == pytest.approx(1.0 - np.exp(-0.002 / np.array([0.025, 0.025])))
    assert abs(one.model.actuator("rotor_1").gear[5]) == pytest.approx(0.5 * 0.016)
    for command, share in ((0.0, 0.1), (0.5, 0.55), (1.0, 1.0)):  # of the full speed: a line
        for _ in range(400):
            one.rotors.step(np.full(4, command), np.zeros(4))
        assert one.rotors.speed[0] == pytest.approx(share * 1100.0)


def test_the_thrust_fades_from_lift_off_on():
    one = plant("thrust_fade:per_minute=0.06", payload=0.0)
    part = one.effects.acting["thrust_fade"].arrays.part
    for thrust, left in ((5.0, 1.0), (5.5, 0.999), (5.0, 0.998)):  # weight: 21.6 N
        one.rotors.thrust[:] = thrust
        for _ in range(250):
            one.effects.bench.lift[:] = 1.0
            tick(one, "thrust_fade")
        assert part[0] == pytest.approx(left)
    assert one.effects.bench.lift == pytest.approx(np.full(4, 0.998))


@pytest.mark.parametrize("turning", [0.0, 1.0])
def test_a_standing_load_acts_in_the_world_or_in_the_body(turning):
    one = plant(f"standing_load:force=1/2/0,torque=0/0/0.1,turning={turning}")
    bench, base = one.effects.bench, one.model.body("base").id
    bench.base_axes[:] = [0, -1, 0, 1, 0, 0, 0, 0, 1]  # turned by 90 deg to the left
    one.data.xfrc_applied[base] = [0.5, 0.0, 0.0, 9.0, 9.0, 9.0]  # drag, and the torque of before
    tick(one, "standing_load")
    force = [-2.0 + 0.5, 1.0, 0.0] if turning else [1.0 + 0.5, 2.0, 0.0]
    assert one.data.xfrc_applied[base] == pytest.approx([*force, 0.0, 0.0, 0.1])


def test_masses_inertias_and_the_centre_of_mass_differ_from_the_file():
    one, calm = plant("mass_mismatch:base=1.1,inertia=1.2,arm=0.9,shift=0.01/0/0.02"), plant()
    base, link = (one.model.body(name).id for name in ("base", "link_2"))
    ratio = one.model.body_mass / np.maximum(calm.model.body_mass, 1e-12)
    assert ratio[[base, link]] == pytest.approx([1.1, 0.9])
    assert one.model.body_inertia[base] == pytest.approx(1.2 * calm.model.body_inertia[base])
    assert one.model.body_inertia[link] == pytest.approx(0.9 * calm.model.body_inertia[link])
    assert one.model.body_ipos[base] - calm.model.body_ipos[base] == pytest.approx([0.01, 0, 0.02])
    assert ratio[one.model.body("payload").id] == 1.0


# Mocap


@pytest.mark.parametrize(
    ("ends", "gap"),
    [
        (([0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]), 1.0),  # parallel
        (([0, 0, 0], [1, 0, 0], [0.5, -1, 0.3], [0.5, 1, 0.3]), 0.3),  # crossing above
        (([0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]), 1.0),  # in line
        (([0, 0, 0], [0, 0, 0], [0, 3, 4], [0, 3, 8]), 5.0),  # a point
    ],
)
def test_distance_of_segments(ends, gap):
    assert distance(*(np.array(end, dtype=float) for end in ends)) == pytest.approx(gap)


def test_a_link_in_the_line_of_sight_hides_a_marker():
    base, marker = np.array([0.0, 0.0, 1.0]), np.zeros((1, 3))
    cameras = np.array([[4.0, 0, 1.0], [-4.0, 0, 1.0]])
    seen = np.zeros(1, dtype=np.bool_)
    away = np.array([[0.2, 0, 0.5], [0.2, 0, 0.8]])
    across = np.array([[0.2, 0, 0.5], [0.2, 0, 1.2]])
    assert seen_markers(base, LEVEL, marker, cameras, away, 0.03, seen) == 1
    assert seen_markers(base, LEVEL, marker, cameras, across, 0.03, seen) == 0 and not seen[0]


def test_hidden_markers_shift_the_pose_by_their_errors():
    # two markers on the x axis are seen; errors: both 1 mm up, the outer one 2 mm to the left
    markers = np.array([[0.1, 0, 0], [-0.1, 0, 0], [0, 0.3, 0]])
    errors = np.array([[0, 0.002, 0.001], [0, 0, 0.001], [9, 9, 9]])
    pose = np.array([0.0, 1, 2, 3, 1, 0, 0, 0])
    shift_pose(pose, LEVEL, markers, errors, np.array([True, True, False]))
    assert pose[1:4] == pytest.approx([1.0, 2.001, 3.001])
    assert pose[4:] == pytest.approx([1.0, 0, 0, 0.01 / 2], abs=2e-5)  # 2 mm over 0.2 m about z


def test_a_thick_arm_hides_the_vehicle():
    one = plant("arm_occlusion")
    arrays, bench = one.effects.acting["arm_occlusion"].arrays, one.effects.bench
    for thickness in (0.0, 5.0):
        bench.pose[:], bench.lost = 0.5, False
        hide(arrays._replace(thickness=thickness))
        assert bench.lost == (thickness == 5.0) and np.all(bench.pose == 0.5)


def test_stamps_jitter_but_never_go_back_and_the_position_wanders():
    one = plant("mocap_jitter:stamp=0.01,wander=0.001,wander_time=0.01")
    poses = []
    for k in range(2000):
        one.effects.draw()
        one.effects.bench.pose[0:4] = k / 120.0, 0.0, 0.0, 0.0
        jitter(one.effects.acting["mocap_jitter"].arrays)
        poses.append(one.effects.bench.pose[0:4].copy())
    assert np.all(np.diff(np.array(poses)[:, 0]) > 0.0)
    assert np.std(np.array(poses)[:, 1:]) == pytest.approx(0.001, rel=0.1)


def test_dropouts_lose_their_share_and_bursts():
    def lost(spec):
        one, found = plant(f"mocap_dropouts:{spec}"), []
        for k in range(12000):
            one.effects.draw()
            one.effects.bench.lost = False
            one.effects.bench.pose[0] = k / 120.0
            drop(one.effects.acting["mocap_dropouts"].arrays)
            found.append("x" if one.effects.bench.lost else ".")
        return "".join(found)

    assert lost("share=0.1,bursts=0").count("x") / 12000 == pytest.approx(0.1, abs=0.01)
    bursts = lost("share=0,bursts=1,burst_time=0.05,longest=0.2")
    longest = max(map(len, bursts.split(".")))
    assert 6 <= longest <= 1 + 0.2 * 120 and 0.02 < bursts.count("x") / 12000 < 0.1


@pytest.mark.parametrize("rate", [30.0, 60.0, 360.0])
def test_the_motion_capture_has_another_rate_and_delay(rate):
    feed = f"mocap_feed:rate={rate},position_noise=0,attitude_noise=0,latency=0.02"
    one, found, places = plant(feed), [], []
    for k in range(250):
        found += [(k, pose) for pose in one.sense().poses]
        places.append(one.truth().state[0, :3])
        one.step(np.full(4, 0.7), np.zeros(2), False)
    stamps = np.array([pose[0] for _, pose in found])
    assert len(stamps) == pytest.approx(rate * 0.98, abs=2)  # several in a tick
    apart = 4e-3 if rate < 250.0 else 1e-6  # of the ticks, or of its own time
    assert np.diff(stamps) == pytest.approx(1.0 / rate, abs=apart)
    for k, (stamp, place, _) in found:
        assert 0.02 - 1e-9 <= 0.004 * k - stamp < 0.024
        path = [np.interp(stamp, 0.004 * np.arange(250), axis) for axis in np.array(places).T]
        assert place == pytest.approx(path, abs=5e-5)  # of its own time, also between two ticks


def test_the_frame_of_an_odometry_by_hand():
    """A quarter turn and a shift; a jump of 0.5 m along y; one that would lead on goes back."""
    frame = np.array([1.0, 2.0, 3.0, math.pi / 2.0])
    position, quaternion = np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0])
    express(frame, position, quaternion)
    assert position == pytest.approx([1.0, 3.0, 3.5])
    assert quaternion == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    frame = np.zeros(4)
    jump(frame, np.array([0.0, 7.0, 0.0, 1.0]), 0.5, 0.1)
    assert frame == pytest.approx([0.0, 0.5, 0.0, -0.1])
    jump(frame, np.array([0.0, 1.0, 0.0, 1.0]), 0.4, 0.1)
    assert frame == pytest.approx([0.0, 0.1, 0.0, 0.0])


def test_an_odometry_drifts_and_jumps_as_often_as_said():
    one = plant("odometry_drift:walk=0,turn=0,jumps=0.9,jump=0.3,jump_turn=0")
    acting, drift = one.effects.acting["odometry_drift"], []
    for _ in range(2400):  # 20 s at 120 Hz
        one.effects.draw()
        acting.steps["pose"](acting.arrays)
        drift.append(acting.arrays.frame[:3].copy())
    ways = np.linalg.norm(np.diff(drift, axis=0), axis=1)
    assert 8 <= np.count_nonzero(ways) <= 30 and ways[ways > 0.0] == pytest.approx(0.3)
    one = plant("odometry_drift:walk=0.1,turn=0,jumps=0,jump=0,jump_turn=0")
    acting, drift = one.effects.acting["odometry_drift"], []
    for _ in range(12000):
        one.effects.draw()
        acting.steps["pose"](acting.arrays)
        drift.append(acting.arrays.frame[:3].copy())
    seconds = np.diff(drift[::120], axis=0)
    assert np.std(seconds) == pytest.approx(0.1, rel=0.2)


# An effect of a user's own, in Python


class Gust(Effect):
    """Somebody's own effect."""

    SOURCE = "a test of the simulator, no measurement"
    lift: float = size("factor on the thrust", "1", 0.0, 2.0)

    def begin(self, bench, noise):
        return OwnGust(self, bench)


class OwnGust(Acting):
    def __init__(self, p, bench):
        self.p, self.bench = p, bench

    def tick(self):
        if self.p.lift == 0.0:
            raise ValueError("no lift")
        self.bench.lift *= self.p.lift

    def imu(self, gyro, force):
        return gyro + 1.0, force

    def pose(self, pose):
        return None if pose[0] > 0.1 else (pose[0], pose[1] + 1.0, pose[2])

    def lateness(self):
        return 0.008


def test_an_effect_in_python_acts_at_every_hook_and_its_errors_come_out(monkeypatch):
    monkeypatch.setitem(EFFECTS, "gust", Gust)
    monkeypatch.setattr(presets, "laboratory", lambda: {})
    one = plant(
        "gust:lift=0.5", "mocap_feed:rate=125,position_noise=0,attitude_noise=0,latency=0.0"
    )
    assert not one.compiled
    samples, states = flown(one)
    calm = flown(plant())[0]
    assert samples[0].hil[1] == pytest.approx(calm[0].hil[1] + 1.0)
    poses = {k: s.mocap for k, s in enumerate(samples) if s.mocap is not None}
    assert min(poses) == 2 and max(pose[0] for pose in poses.values()) <= 0.1  # 8 ms late; lost
    assert poses[2][1] == pytest.approx(states[0, 0, :3] + 1.0)
    with pytest.raises(ValueError, match="no lift"):
        flown(plant("gust:lift=0"))


# Network


class Wire:
    """A transport that notes what it sends."""

    stream, bytes_per_second, connected, dropped = False, None, True, 0

    def __init__(self):
        self.sent = []

    def send(self, data):
        self.sent.append(data)
        return True


def test_messages_arrive_after_the_delay_and_in_order():
    wire = Wire()
    late = LateTransport(wire, SetpointDelay(0.006, 0.0, 0.0, 1))
    for tick in range(5):
        late.update(0.004 * tick)
        assert late.send(bytes([tick]))
        assert wire.sent == [bytes([k]) for k in range(max(0, tick - 1))]  # 6 ms: two ticks later


def test_a_message_without_delay_is_sent_at_once_unless_another_waits():
    wire = Wire()
    late = LateTransport(wire, SetpointDelay(0.0, 0.0, 0.0, 1))
    late.update(0.0)
    late.send(b"a")
    assert wire.sent == [b"a"]


def test_delays_have_the_stated_quantiles_and_are_those_of_the_seed():
    made = presets.read((), ["network_delay"])
    delay = SetpointDelay.of(made, 5)
    again = SetpointDelay.from_text(delay.to_text())
    late = np.array([delay.at(0.004 * tick) for tick in range(20000)])
    assert delay.at(0.0) == late[-1]  # further messages of a tick, and older ticks
    assert np.array_equal(late, [again.at(0.004 * tick) for tick in range(20000)])
    assert np.quantile(late, 0.5) == pytest.approx(0.004, abs=2e-4)
    assert np.quantile(late, 0.99) == pytest.approx(0.012, abs=6e-4)
    assert SetpointDelay.of({}, 5) is None and SetpointDelay.from_text("") is None
    with pytest.raises(ValueError, match="is not valid"):
        SetpointDelay.from_text("late")


def test_poses_arrive_later_with_the_stamp_of_their_exposure():
    def ages(*specs):
        samples, _ = flown(plant(*specs), 200, 0.0)
        return [0.004 * k - s.mocap[0] for k, s in enumerate(samples) if s.mocap is not None]

    assert set(np.round(ages(), 9)) == {0.012}
    late = ages("network_delay:mocap=0.02,mocap_jitter=0")
    assert set(np.round(late, 9)) == {0.032}

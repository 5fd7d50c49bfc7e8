"""The effects of a laboratory on the plant: each by hand, and what they leave alone."""

import math

import numpy as np
import pytest
from effects_rig import column, flown, plant, same, tick
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.faulty_plant import make_plant
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.actuators import rotor_step
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.acting_effects import generator
from uam_sim_bridge.plant.effects.catalogue import EFFECTS
from uam_sim_bridge.plant.effects.effect import Acting, Effect, size
from uam_sim_bridge.plant.effects.load_effects import momentum
from uam_sim_bridge.plant.effects.rotor_effects import (
    Shaken,
    discharge,
    mean_of_wave,
    raise_thrust,
    thrust_ratio,
    vibrate,
)
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.plant import PlantError

LEVEL = np.eye(3).ravel()
SENSING = ("propeller_vibration", "mocap_jitter", "mocap_dropouts", "arm_occlusion")
MOCAP = ("mocap_jitter", "mocap_dropouts", "arm_occlusion")


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
    numbers = battery[-1]
    one.rotors.thrust[:] = 5.4
    # ideal power 5.4^1.5 / sqrt(2 1.2 pi 0.127^2) = 35.98 W per rotor; 4 / 0.6 of it and 20 W
    power = 4 * 35.98 / 0.6 + 20.0
    discharge(battery)
    assert one.rotors.constants[1] == pytest.approx(8.549e-6 * 1100.0**2)  # full, no current yet
    gain = 1.0 - math.exp(-0.004 / 0.1)
    assert numbers["current"] == pytest.approx(gain * power / 16.2, rel=1e-3)
    numbers["current"] = 16.0
    discharge(battery)
    sag = (16.2 - 4 * 0.005 * 16.0) / 16.2  # 0.98025
    assert one.rotors.constants[1] == pytest.approx(8.549e-6 * 1100.0**2 * sag**2, rel=1e-5)
    numbers["charge"] = 0.0
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


# Rotors, masses and loads that are not the vehicle file's


def test_rotors_differ_from_the_file_by_the_factors():
    one = plant("rotor_mismatch:thrust=1/1/0.9/1,yaw=0.5,lag_up=2,lag_down=1,idle=0.1")
    assert one.rotors.efficiency == pytest.approx([1.0, 1.0, 0.9, 1.0])
    assert one.rotors.gains[:, 0] == pytest.approx(1.0 - np.exp(-0.002 / np.array([0.025, 0.025])))
    assert abs(one.model.actuator("rotor_1").gear[5]) == pytest.approx(0.5 * 0.016)
    for command, share in ((0.0, 0.1), (0.5, 0.55), (1.0, 1.0)):  # of the full speed: a line
        for _ in range(400):
            rotor_step(np.full(4, command), one.rotors.arrays, np.zeros(4))
        assert one.rotors.speed[0] == pytest.approx(share * 1100.0)


def test_the_thrust_fades_from_lift_off_on():
    one = plant("thrust_fade:per_minute=0.06", payload=0.0)
    part = one.effects.acting["thrust_fade"].arrays[2]
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

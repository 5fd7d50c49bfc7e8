"""The description of a vehicle: what follows from it, and what is refused."""

import math
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
import yaml

from uam_control.grasp.sight import hand_and_levers
from uam_control.mission import load_scenario
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.profiles.profile import default_profile
from uam_control.setpoints.rate_thrust_map import RateThrustMap
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError, chain_of, derived_parameters, load_description
from uam_control.vehicle.loading import HOVERS, describe
from uam_control.vehicle.rotor_geometry import normalised_mixer
from uam_lab.analysis import dynamics, supply
from uam_lab.records.results.timeseries import Series, columns_of
from uam_sim_bridge.autopilot.params import DEFINITIONS, Parameters
from uam_sim_bridge.faults import FaultError, feasibility, read_schedule
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.actuators import joint_step
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

S500 = load_description()


def changed(*changes):
    """The S-500 with entries replaced: (path of keys, value)."""
    numbers = deepcopy(S500.numbers)
    for keys, value in changes:
        entry = numbers
        for key in keys[:-1]:
            entry = entry[key]
        entry[keys[-1]] = value
    return numbers


def test_the_autopilot_of_the_s500():
    # FLU y is left, PX4's is right; PX4 counts counter-clockwise rotors positive
    values = S500.autopilot_parameters()
    assert values["CA_ROTOR_COUNT"] == 4 and values["THR_MDL_FAC"] == 0.3
    rotors = [[values[f"CA_ROTOR{i}_{what}"] for what in ("PX", "PY", "KM")] for i in range(4)]
    assert rotors == [
        [0.171, 0.171, 0.016], [-0.171, -0.171, 0.016],
        [0.171, -0.171, -0.016], [-0.171, 0.171, -0.016],
    ]  # fmt: skip
    assert [values[f"CA_ROTOR{i}_CT"] for i in range(4)] == [6.5] * 4  # PX4's default
    # 2.2 kg * 9.81 m/s^2 / (4 * 8.549e-6 * 1100^2 N) = 0.5216
    assert values["MPC_THR_HOVER"] == 0.52
    autopilot = Parameters.of(S500)
    assert all(autopilot[name] == value for name, value in values.items())


def test_the_nodes_of_the_s500():
    nodes = derived_parameters(S500)
    # 110 and 120 deg are 1.9199 and 2.0944 rad
    assert nodes["mission"]["joint_angle_hold"] == [1.9, 2.05]
    assert nodes["mission"]["joint_effort_hold"] == [2.8, 2.8]
    assert nodes["position_controller"]["gravity_feedforward_mass"] == 2.2
    # 8.549e-6 * 1100^2 = 10.34429
    assert nodes["mavlink_bridge"]["rotor_thrust_max"] == 10.34


def test_a_range_beside_zero_is_held_at_both_of_its_ends():
    described = describe(changed((("joints", 1, "range_deg"), [-30, 100])), S500.file)
    values = derived_parameters(described)["mission"]
    # half of 130 deg is 1.1345 rad, 35 deg is 0.610865
    assert values["joint_angle_hold"] == [1.9, 1.1]
    assert values["joint_angle_middle"] == [0.0, 0.610865]
    low, high = MissionParameters.from_mapping(values, 2).joint_ranges
    np.testing.assert_allclose(low, [-1.9, -0.489135])
    np.testing.assert_allclose(high, [1.9, 1.710865])


def test_what_the_model_is_made_of():
    model = Vehicle.of(S500).compile(0.2)
    low, high = model.joint("alpha_2").range
    assert (low, high) == pytest.approx((-math.radians(120), math.radians(120)))
    np.testing.assert_allclose(model.site("rotor_2").pos, [-0.171, 0.171, 0.050])
    assert model.actuator("rotor_1").gear[5] == -0.016, "a ccw propeller turns the base clockwise"
    assert model.opt.gravity[2] == -9.81
    assert [model.actuator(i).name for i in range(model.nu)] == [
        "rotor_1", "rotor_2", "rotor_3", "rotor_4", "alpha_1", "alpha_2", "magnet",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((("model",), "none.xml"), "none.xml does not exist"),
        ((("mass",), -1.0), "s500_arm.yaml: mass: -1 is not above 0"),
        ((("mass",), "heavy"), "mass: a number expected, got 'heavy'"),
        (
            (("mass",), 5.0),
            "a weight of 49.1 N, needs 119 % of the full thrust of the rotors, 41.4",
        ),
        ((("mass",), 3.5), "needs 83 % of the full thrust of the rotors, 41.4 N; 10 to 80 % are"),
        ((("rotors", "speed_max"), 2600.0), "needs 9.34 % of the full thrust of the rotors, 231.2"),
        ((("gravity",), math.inf), "gravity: inf is not finite"),
        ((("rotors", "curve_factor"), 1.5), "rotors.curve_factor: 1.5 is outside 0..1"),
        ((("rotors", "lag_down"), 25), "rotors.lag_down: 25 s; in ms? at most 1 s"),
        ((("rotors", "efficiency"), [1.0]), "rotors.efficiency: a list of 4 numbers expected"),
        ((("rotors", "layout"), []), "rotors.layout: a list of mappings expected"),
        ((("rotors", "layout", 1, "direction"), "left"), "layout[1].direction: 'left' is not one"),
        ((("rotors", "layout", 1, "position"), [0.171, -0.171, 0.05]), "roll, pitch, yaw and thr"),
        ((("rotors", "layout", 1, "name"), "rotor_1"), "rotor_1: the name of several parts"),
        ((("rotors", "layout", 1, "position"), [0, 0]), "position: a list of 3 numbers expected"),
        ((("joints", 0, "range_deg"), [0, 11]), "[0, 11] is less than 11.5 deg wide"),
        ((("joints", 1, "stowed_deg"), 150), "joints[1].stowed_deg: 150 is outside the joint"),
        ((("servos", "effort_limit"), 4.0), "4 N m is above stall_torque, 3 N m"),
        ((("joints",), 2), "joints: a list of mappings expected, got 2"),
        ((("control_period",), 0.02), "control_period: 0.02 s is above 0.008 s"),
        ((("control_period",), 0.01), "control_period: 0.01 s is above 0.008 s"),
        ((("air", "drag"), [0.1, 0.1, -0.2]), "air.drag: -0.2 N s/m is below 0"),
        ((("air", "drag"), [0.1]), "air.drag: a list of 3 numbers expected"),
        ((("sensors", "mocap", "rate"), 361), "sensors.mocap.rate: 361 Hz; allowed: 30 to 360 Hz"),
        ((("sensors", "mocap", "rate"), 0), "sensors.mocap.rate: 0 Hz; allowed: 30 to 360 Hz"),
        (
            (("sensors", "imu", "latency_ticks"), 1.5),
            "latency_ticks: a whole number expected, 0, 1, .., got 1.5",
        ),
        ((("magnet", "holding_force"), "strong"), "magnet.holding_force: a number expected"),
        ((("magnet", "curve"), [[0.0, 1.2]]), "magnet.curve: [[0.0, 1.2]]; allowed: [[gap in m,"),
        ((("magnet", "curve"), [[0.1, 1.0], [0.0, 0.5]]), "by growing gaps"),
        ((("magnet", "curve"), [0.1, 1.0]), "by growing gaps"),
        ((("magnet", "curve"), "steep"), "magnet.curve: steep; allowed"),
    ],
)
def test_what_cannot_be_a_vehicle_is_refused_in_one_line(change, message):
    with pytest.raises(VehicleError) as error:
        describe(changed(change), S500.file)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_two_rotors_at_one_place_are_refused_where_the_others_could_fly():
    hexa = load_description("hexa_arm")
    numbers = deepcopy(hexa.numbers)
    layout = numbers["rotors"]["layout"]
    layout[5]["position"] = list(layout[1]["position"])
    with pytest.raises(VehicleError, match="rotors.layout: rotor_6 is where rotor_2 is"):
        describe(numbers, hexa.file)


@pytest.mark.parametrize(
    "change",
    [(("control_period",), 0.008), (("mass",), 3.39), (("rotors", "speed_max"), 2500.0)],
)
def test_what_just_flies_is_read(change):
    assert Parameters.of(describe(changed(change), S500.file))["MPC_THR_HOVER"] <= 0.8


def test_the_hover_of_every_vehicle_is_in_the_range_of_the_autopilot():
    hover = DEFINITIONS["MPC_THR_HOVER"]
    assert (hover.low, hover.high) == HOVERS


@pytest.mark.parametrize(
    "key",
    [
        *("model", "mass", "rotors", "joints", "servos"),
        *("air", "sensors", "variation"),
    ],
)
def test_what_is_missing_is_named(key):
    numbers = deepcopy(S500.numbers)
    del numbers[key]
    with pytest.raises(VehicleError, match=f"s500_arm.yaml: {key} is missing"):
        describe(numbers, S500.file)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((("mass",), 2.3), "the bodies weigh 2.2 kg in all, s500_arm.yaml has mass: 2.3"),
        ((("control_period",), 0.005), "timestep 0.002 s does not divide control_period"),
        ((("joints", 1, "name"), "elbow"), "no joint 'elbow'"),
        (
            (("joints",), S500.numbers["joints"][:1]),
            "joint 'alpha_2' is not in s500_arm.yaml, which has: alpha_1",
        ),
        ((("joints",), S500.numbers["joints"][::-1]), "each joint must follow the one before it"),
    ],
)
def test_what_contradicts_the_mjcf_is_refused_in_one_line(change, message):
    numbers = changed(change)
    described = describe(numbers, S500.file)
    with pytest.raises(VehicleError) as error:
        MujocoPlant(Vehicle.of(described), 0.0, 1)
    assert message in str(error.value) and "\n" not in str(error.value)


def two_servos(**changes):
    """The S-500 with a weaker servo at its second joint; changes: of that type."""
    one = S500.numbers["servos"]
    weak = one | {"stall_torque": 1.5, "effort_limit": 1.2, "current_unit": 0.001} | changes
    joints = [
        entry | {"servo": name}
        for entry, name in zip(S500.numbers["joints"], ("strong", "weak"), strict=True)
    ]
    return S500.numbers | {"servos": {"strong": one, "weak": weak}, "joints": joints}


def test_a_servo_type_for_each_joint():
    described = describe(two_servos(), S500.file)
    assert derived_parameters(described)["mission"]["joint_effort_hold"] == [2.8, 1.2]
    assert [described.servo_numbers(i)["current_unit"] for i in range(2)] == [0.00269, 0.001]
    servos = MujocoPlant(Vehicle.of(described), 0.0, 1).servos
    servos.command[:] = 2.0
    joint_step(servos.arrays, np.zeros(2), np.zeros(2), np.zeros(2))
    # whole current units of 3.508 mN m; the weak one's stall torque
    assert servos.torque == pytest.approx([round(2.0 / 0.00350776) * 0.00350776, 1.5])


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (two_servos(mode="position"), "servos.mode: strong current, weak position: the servos of"),
        (two_servos(effort_limit=2.0), "servos.weak.effort_limit: 2 N m is above stall_torque"),
        (two_servos() | {"joints": S500.numbers["joints"]}, "joints[0].servo is missing"),
        (S500.numbers | {"joints": two_servos()["joints"]}, "joints[0].servo: servos has no types"),
        (
            two_servos() | {"joints": [two_servos()["joints"][0]]},
            "servos.weak: no joint has this servo",
        ),
    ],
)
def test_servo_types_that_contradict_are_refused_in_one_line(numbers, message):
    with pytest.raises(VehicleError) as error:
        describe(numbers, S500.file)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_a_section_of_older_files_is_left_alone():
    numbers = S500.numbers | {"arm": {"mount": [0, 0, 0], "links": [1, 1], "magnet": 0.03}}
    assert describe(numbers, S500.file).servos == S500.servos


@pytest.mark.parametrize("name", ["s500_arm", "s500_arm3", "hexa_arm"])
def test_the_arm_reaches_as_far_as_in_the_mjcf(name):
    vehicle = Vehicle.load(name)
    angles = np.linspace(0.3, 0.8, len(vehicle.description.joints))
    plant = MujocoPlant(vehicle, 0.2, 1, tuple(angles))
    chi = np.concatenate([plant.data.qpos[:3], np.zeros(3), angles])
    face = plant.data.site_xpos[plant.model.site("magnet_face").id]
    found, _ = hand_and_levers(chain_of(vehicle.description), chi)
    assert found == pytest.approx(face, abs=1e-6)


def test_a_range_of_the_mjcf_may_repeat_but_not_contradict(tmp_path):
    folder = S500.file.parent
    for part in folder.glob("parts/*"):
        (tmp_path / "parts").mkdir(exist_ok=True)
        (tmp_path / "parts" / part.name).write_text(part.read_text())
    (tmp_path / S500.model.name).write_text(S500.model.read_text())
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(S500.numbers))
    arm = tmp_path / "parts" / "arm_2r.xml"
    plain, where = arm.read_text(), 'name="alpha_1" class="arm_link"'
    assert where in plain
    mine = Vehicle.load(str(tmp_path / "mine.yaml"))
    arm.write_text(plain.replace(where, f'{where} range="-110 110"'))
    assert mine.compile(0.0).joint("alpha_1").range[1] == pytest.approx(math.radians(110))
    arm.write_text(plain.replace(where, f'{where} range="-90 110"'))
    with pytest.raises(VehicleError, match=r"'alpha_1' has the range \[-90.0, 110.0\], mine.yaml"):
        mine.compile(0.0)


def test_unknown_vehicles_are_refused():
    with pytest.raises(ConfigurationError, match="unknown vehicle 'bicycle'; .*s500_arm"):
        load_description("bicycle")
    with pytest.raises(ConfigurationError, match="does not exist"):
        load_description("none.yaml")
    with pytest.raises(VehicleError, match="not valid YAML|a mapping expected"):
        load_description(str(Path(__file__)))


def test_no_python_file_names_a_vehicle_but_the_default():
    root = Path(__file__).resolve().parents[2]
    names = [name for name in configuration.names("vehicle", (".yaml",)) if name != S500.name]
    assert {"hexa_arm", "s500_arm3"} <= set(names)
    for package in ("uam_control", "uam_msgs_py", "uam_sim_bridge", "uam_lab"):
        for file in (root / package).rglob("*.py"):
            text = file.read_text()
            assert not [name for name in names if name in text], file
            assert S500.name not in text or file.name == "loading.py", file


def test_the_allocation_of_a_hexacopter():
    # PX4's hexarotor x: right cw, left ccw, front-left cw, back-right ccw, front-right ccw, ...
    px, py, km = load_description("hexa_arm").geometry()
    angles = np.degrees(np.arctan2(py, px))
    np.testing.assert_allclose(angles, [90, -90, -30, 150, 30, -150], atol=0.1)
    np.testing.assert_allclose(np.hypot(px, py), 0.275, rtol=1e-3)
    np.testing.assert_array_equal(np.sign(km), [-1, 1, -1, 1, 1, -1])
    # roll and pitch are scaled alike: columns of norm sqrt(6/2) and sqrt(4/2) before the larger one
    mixer = normalised_mixer(px, py, km)
    np.testing.assert_allclose(mixer[:, 3], 1.0)
    np.testing.assert_allclose(np.abs(mixer[:, 2]), 1.0)
    np.testing.assert_allclose(mixer[:, 0], -py / 0.275 * mixer[1, 0], atol=1e-3)
    np.testing.assert_allclose(mixer[:, 1], px / 0.2382 * mixer[2, 1], atol=1e-3)


@pytest.mark.parametrize(
    ("name", "fault", "message"),
    [
        (S500.name, "motor_loss@1:motor=5", "motor_loss: motor 5: the vehicle has 4"),
        (S500.name, "servo_jam@1:joint=3", "servo_jam: joint 3: the vehicle has 2"),
        ("hexa_arm", "motor_loss@1:motor=5", ""),
        ("s500_arm3", "encoder_stuck@1:joint=3", ""),
    ],
)
def test_faults_count_the_parts_of_the_vehicle(name, fault, message):
    described = load_description(name)
    schedule = read_schedule([fault], load_scenario("hover", described), 1)
    if not message:
        feasibility.check(schedule, "direct", vehicle=described)
        return
    with pytest.raises(FaultError, match=message):
        feasibility.check(schedule, "direct", vehicle=described)


def test_the_estimator_and_the_identification_take_the_gravity_of_the_vehicle():
    mars = describe(changed((("gravity",), 3.71)), S500.file)
    profile = default_profile("modular", mars)
    assert profile.sets["state_estimator"].gravity == 3.71
    assert profile.sets["position_controller"].gravity == 3.71
    assert RateThrustMap(vehicle=mars).gravity == 3.71


def test_the_wrench_of_six_rotors():
    # upright, rotor i with i newtons: 21 N; roll torque sum of y F, pitch torque -sum of x F
    vehicle = Vehicle.load("hexa_arm")
    columns = columns_of(vehicle.description)
    values = np.zeros((1, len(columns)))
    for i in range(1, 7):
        values[0, columns[f"rotor_{i}.thrust"]] = float(i)
    series = Series(values, np.zeros(1, dtype=np.int8), ("flight",), {}, columns)
    wrench = supply.rotor_wrench(series, np.array([0]), dynamics.Body(vehicle))[0]
    roll = -0.275 + 2 * 0.275 + 0.1375 * (3 - 4 - 5 + 6)
    pitch = -0.2382 * (3 - 4 + 5 - 6)
    yaw = 0.016 * (1 - 2 + 3 - 4 - 5 + 6)  # a cw propeller turns the base counter-clockwise
    assert wrench == pytest.approx([0.0, 0.0, 21.0, roll, pitch, yaw], abs=1e-12)

"""Each fault of the plant has the effect in the catalogue, and none before begin and after end."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.mission import load_scenario
from uam_sim_bridge.faults import FAULTS, PLANT, FaultError, Schedule, read_schedule
from uam_sim_bridge.faults.faulty_plant import FaultyPlant, make_plant
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

VEHICLE = Vehicle.load()
SCENARIO = load_scenario("pick_and_place")
START = (VEHICLE, 0.2, 3, (0.3, 0.4))
BEGIN, END = 0.1, 0.3  # [s]
HOVER = np.full(4, 0.62)


def plant_with(text):
    plant = make_plant(*START, read_schedule([text], SCENARIO, 5))
    plant.timeline.mission_at(0.0, 0.0, "take-off")
    return plant


def run(plant, until=0.4, effort=(0.05, 0.1), magnet=False, motors=HOVER):
    """Return (time, samples, truth before the step) of each tick."""
    rows = []
    while plant.time < until - 1e-9:
        time, truth = plant.time, plant.truth()
        rows.append((time, plant.sense(), truth))
        plant.step(motors, np.array(effort), magnet)
    return rows


def ticks(rows, begin, end):
    """Return the entries with begin <= time < end, times in [s]."""
    return [entry for entry in rows if begin - 1e-9 <= entry[0] < end - 1e-9]


def during(rows):
    return ticks(rows, BEGIN, END)


def poses(entries):
    return [samples.mocap for _, samples, _ in entries if samples.mocap is not None]


def faulty(name, values=""):
    return run(plant_with(f"{name}@{BEGIN}+{END - BEGIN:g}" + (f":{values}" if values else "")))


NOMINAL = run(MujocoPlant(*START))


def equal(a, b):
    if a is None or b is None:
        return a is b
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


PLANT_FAULTS = [name for name, kind in FAULTS.items() if kind.PLACE == PLANT]
VALUES = {
    "imu_saturation": "gyro=0.001,accelerometer=1",
    "mocap_outliers": "share=1",
    "servo_weak": "joint=2",
}
NEEDS_THE_MAGNET = ("magnet_weak", "magnet_stuck", "payload_swing")


@pytest.mark.parametrize("name", PLANT_FAULTS)
def test_before_its_beginning_a_fault_changes_nothing(name):
    rows = faulty(name, VALUES.get(name, ""))
    for (_, ours, truth), (_, usual, true) in zip(
        ticks(rows, 0.0, BEGIN), ticks(NOMINAL, 0.0, BEGIN), strict=True
    ):
        assert all(
            equal(getattr(ours, k), getattr(usual, k)) for k in ("imu", "joints", "mocap", "hil")
        )
        assert np.array_equal(truth.state, true.state)


@pytest.mark.parametrize("name", [n for n in PLANT_FAULTS if n not in NEEDS_THE_MAGNET])
def test_every_fault_changes_the_samples(name):
    rows = faulty(name, VALUES.get(name, ""))
    assert not all(
        equal(getattr(ours, kind), getattr(usual, kind))
        for (_, ours, _), (_, usual, _) in zip(during(rows), during(NOMINAL), strict=True)
        for kind in ("imu", "joints", "mocap", "hil")
    )


@pytest.mark.parametrize("name", [n for n in PLANT_FAULTS if n.startswith(("mocap", "clock"))])
def test_faults_of_the_motion_capture_leave_no_trace_after_their_end(name):
    """Without a controller these faults do not act on the motion of the vehicle."""
    rows = faulty(name)
    after = (
        0.05 if name == "mocap_latency" else 0.0
    )  # delayed poses of that time have arrived already
    for (_, ours, _), (_, usual, _) in zip(
        ticks(rows, END + after, 1.0), ticks(NOMINAL, END + after, 1.0), strict=True
    ):
        assert equal(ours.mocap, usual.mocap)


@pytest.mark.parametrize(
    ("fault", "senses", "acts"),
    [("mocap_dropout", True, False), ("servo_weak", False, True), ("wind_gust", False, True)],
)
def test_a_fault_says_what_it_changes_until_it_is_over(fault, senses, acts):
    plant, found = plant_with(f"{fault}@0.1+0.2"), []
    while plant.time < 0.4:
        plant.sense()
        found.append((plant.time, plant.senses, plant.acts))
        plant.step(HOVER, np.zeros(2), False)
    assert {one[1:] for one in ticks(found, BEGIN, END)} == {(senses, acts)}
    assert {one[1:] for one in ticks(found, 0.0, BEGIN)} == {(False, False)}
    after = ticks(found, END, 0.4)
    assert after[0][2] == acts  # once more, which undoes it
    assert {one[1:] for one in after[1:]} == {(False, False)}


def test_no_poses_arrive():
    rows = faulty("mocap_dropout")
    assert poses(during(rows)) == [] and len(poses(rows)) > 10


def test_a_frozen_pose_repeats_with_new_stamps():
    found = poses(during(faulty("mocap_freeze")))
    stamps = [pose[0] for pose in found]
    assert len(found) > 15 and sorted(set(stamps)) == stamps
    assert all(equal(pose[1:], found[0][1:]) for pose in found)


def test_poses_are_displaced_and_turned():
    found = poses(during(faulty("mocap_jump", "x=0.5,y=-0.25,yaw=1.5707963")))
    for ours, usual in zip(found, poses(during(NOMINAL)), strict=True):
        np.testing.assert_allclose(ours[1] - usual[1], [0.5, -0.25, 0.0], atol=1e-12)
        w, _, _, z = ours[2]
        assert 2.0 * np.arctan2(z, w) == pytest.approx(np.pi / 2, abs=0.02)


def test_axes_are_exchanged():
    found = poses(during(faulty("mocap_swap", "axes=xz")))
    for ours, usual in zip(found, poses(during(NOMINAL)), strict=True):
        assert np.array_equal(ours[1], usual[1][[2, 1, 0]])


def test_poses_come_late_and_none_twice():
    rows = faulty("mocap_latency", "delay=0.04")
    usual = poses(NOMINAL)
    late = [(t, s.mocap[0]) for t, s, _ in during(rows) if s.mocap is not None]
    assert late[0][0] == pytest.approx(BEGIN + 0.04, abs=0.009)
    assert all(t - stamp == pytest.approx(0.012 + 0.04, abs=1e-9) for t, stamp in late)
    stamps = [pose[0] for pose in poses(rows)]
    assert stamps == sorted(set(stamps)) and set(stamps) <= {pose[0] for pose in usual}


def test_some_poses_are_far_off_the_same_ones_for_the_same_seed():
    first, again = faulty("mocap_outliers", "share=0.5"), faulty("mocap_outliers", "share=0.5")
    distances = [
        np.linalg.norm(a[1] - b[1])
        for a, b in zip(poses(during(first)), poses(during(NOMINAL)), strict=True)
    ]
    off = [d for d in distances if d > 0.0]
    assert 0 < len(off) < len(distances) and np.allclose(off, 0.5)
    assert all(equal(a, b) for a, b in zip(poses(first), poses(again), strict=True))


def test_stamps_are_off():
    found = poses(during(faulty("clock_jump", "step=2.5")))
    for ours, usual in zip(found, poses(during(NOMINAL)), strict=True):
        assert ours[0] == usual[0] + 2.5 and equal(ours[1:], usual[1:])


@pytest.mark.parametrize(
    ("unit", "felt"), [("both", ("imu", "hil")), ("companion", ("imu",)), ("autopilot", ("hil",))]
)
def test_an_imu_is_biased(unit, felt):
    rows = faulty("imu_bias", f"gyro=0.5,accelerometer=2,axis=y,unit={unit}")
    for (_, ours, _), (_, usual, _) in zip(during(rows), during(NOMINAL), strict=True):
        for kind in ("imu", "hil"):
            size = float(kind in felt)
            _, gyro, force = getattr(ours, kind)
            np.testing.assert_allclose(gyro - getattr(usual, kind)[1], [0, 0.5 * size, 0])
            np.testing.assert_allclose(force - getattr(usual, kind)[2], [0, 2.0 * size, 0])


def test_the_bias_of_an_imu_rises():
    rows = during(faulty("imu_bias", "gyro=0,accelerometer=2,over=0.1"))
    for number, ((_, ours, _), (_, usual, _)) in enumerate(zip(rows, during(NOMINAL), strict=True)):
        rise = [2.0 * min(1.0, number * 0.004 / 0.1), 0.0, 0.0]
        np.testing.assert_allclose(ours.imu[2] - usual.imu[2], rise, atol=1e-9)


def test_an_imu_saturates():
    for _, samples, _ in during(faulty("imu_saturation", "gyro=0.002,accelerometer=3")):
        for _, gyro, force in (samples.imu, samples.hil):
            assert np.max(np.abs(gyro)) <= 0.002 and np.max(np.abs(force)) <= 3.0


def test_an_imu_is_silent_but_the_autopilot_gets_a_sample_at_each_tick():
    rows = faulty("imu_dropout")
    assert all(samples.imu is None for _, samples, _ in during(rows))
    assert all(samples.imu is not None for _, samples, _ in ticks(rows, END, 1.0))
    held = during(faulty("imu_dropout", "unit=autopilot"))
    assert all(equal(s.hil[1:], held[0][1].hil[1:]) and s.imu is not None for _, s, _ in held)
    assert [s.hil[0] for _, s, _ in held] == [t for t, _, _ in held]


def test_an_encoder_is_stuck():
    rows = faulty("encoder_stuck", "joint=2")
    angles = [samples.joints[1] for _, samples, _ in during(rows)]
    assert len({alpha[1] for alpha in angles}) == 1 and len({alpha[0] for alpha in angles}) > 1
    assert all(samples.joints[2][1] == 0.0 for _, samples, _ in during(rows))
    moved = [truth.state[0, 7] for _, _, truth in during(rows)]
    assert np.ptp(moved) > 0.01


def test_a_servo_gives_a_part_of_its_torque():
    unit = 1.304 * 0.00269
    for remaining in (0.0, 0.5):
        rows = run(plant_with(f"servo_weak@{BEGIN}:joint=2,remaining={remaining}"), 0.2)
        torque = rows[-1][1].joints[3]
        assert torque[1] == pytest.approx(0.1 * remaining, abs=unit)
        assert torque[0] == pytest.approx(0.05, abs=unit)


def test_a_jammed_joint_holds_its_angle_and_is_free_afterwards():
    rows = run(plant_with(f"servo_jam@{BEGIN}+0.2:joint=1"), 0.6, effort=(1.0, 0.0))
    # it is braked first
    held = [truth.state[0, 6] for _, _, truth in ticks(rows, BEGIN + 0.1, END)]
    free = [truth.state[0, 6] for _, _, truth in ticks(rows, END, 0.6)]
    assert np.ptp(held) < 0.005 and np.ptp(free) > 0.05


def test_a_motor_gives_a_part_of_its_thrust():
    rows = faulty("motor_loss", "motor=3,remaining=0.25")
    usual = NOMINAL[-1][2].rotor_thrust
    np.testing.assert_allclose(during(rows)[-1][2].rotor_thrust, usual * [1, 1, 0.25, 1], rtol=1e-6)
    np.testing.assert_allclose(rows[-1][2].rotor_thrust, usual, rtol=1e-6)


def test_two_faults_of_one_motor_multiply_and_end_one_by_one():
    both = read_schedule(
        [f"motor_loss@{BEGIN}+0.1:remaining=0.5", f"motor_loss@{BEGIN}+0.2:remaining=0.3"],
        SCENARIO,
        1,
    )
    plant = make_plant(*START, both)
    plant.timeline.mission_at(0.0, 0.0, "take-off")
    efficiency = {}
    while plant.time < 0.4:
        plant.sense()
        plant.step(HOVER, np.zeros(2), False)
        efficiency[round(plant.time, 3)] = plant.physics.rotors.efficiency[0]
    assert [efficiency[t] for t in (0.1, 0.152, 0.252, 0.4)] == [1.0, 0.15, 0.3, 1.0]


def test_thrust_sags_slowly():
    rows = faulty("battery_sag", "remaining=0.6,over=0.1")
    usual = {t: truth.rotor_thrust for t, _, truth in NOMINAL}
    part = [(truth.rotor_thrust / usual[t]) for t, _, truth in ticks(rows, BEGIN + 0.004, END)]
    assert np.all(np.diff(part, axis=0) < 1e-9)
    np.testing.assert_allclose(part[12], 0.8, atol=0.03)
    np.testing.assert_allclose(part[-1], 0.6)


def test_wind_comes_softly_and_goes():
    plant = plant_with(f"wind_gust@{BEGIN}+0.2:speed=8,towards=90,up=-1,rise=0.1")
    winds = {}
    while plant.time < 0.4:
        plant.sense()
        plant.step(HOVER, np.zeros(2), False)
        winds[round(plant.time, 3)] = plant.physics.body.wind.copy()
    np.testing.assert_allclose(winds[0.1], 0.0)
    np.testing.assert_allclose(winds[0.152], [0.0, 4.0, -0.5], atol=0.3)
    np.testing.assert_allclose(winds[0.296], [0.0, 8.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(winds[0.4], 0.0, atol=1e-12)


def test_gusts_go_on_around_the_wind_that_a_fault_adds():
    gusty = Vehicle.load().changed({"air.gust": 1.0})
    usual = MujocoPlant(gusty, 0.2, 3, (0.3, 0.4))
    added = make_plant(
        gusty, 0.2, 3, (0.3, 0.4), read_schedule(["wind_gust@0.1:speed=5,rise=0"], SCENARIO, 1)
    )
    added.timeline.mission_at(0.0, 0.0, "take-off")
    run(usual, 0.4)
    run(added, 0.4)
    np.testing.assert_allclose(
        added.physics.body.wind - usual.body.wind, [5.0, 0.0, 0.0], atol=1e-9
    )


def test_nothing_happens_before_the_mission_begins():
    plant = make_plant(*START, read_schedule(["mocap_dropout@0"], SCENARIO, 1))
    assert len(poses(run(plant, 0.2))) > 10
    plant.timeline.mission_at(0.2, 0.0, "take-off")
    assert poses(run(plant, 0.4)) == []
    assert plant.timeline.records == [
        {"fault": "mocap_dropout", "begin_s": 0.0, "end_s": None, "parameters": {}}
    ]


def lifted(text, until=1.5):
    """Return plant and (time, truth) per tick: payload at the magnet of a vehicle held in the air.

    The magnet is on until 1 s.
    """
    faulty = plant_with(text)
    plant = faulty.physics
    plant.body.alpha[:] = 0.0
    plant.body.swing[:] = 0.0
    base = np.array([0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0])
    face = 2.0 - 0.073 - 0.100 - 0.140 - 0.030
    plant.body.payload[:] = [0.0, 0.0, face - 0.0205, 1.0, 0.0, 0.0, 0.0]
    rows = []
    while plant.time < until - 1e-9:
        plant.body.position[:], plant.body.quaternion[:] = base[:3], base[3:]
        plant.body.velocity[:] = plant.body.rates[:] = 0.0
        faulty.sense()
        faulty.step(np.zeros(4), np.zeros(2), plant.time < 1.0)
        rows.append((plant.time, plant.truth()))
    return faulty, rows


def height(rows, time):
    return next(truth.payload_position[2] for t, truth in rows if t >= time - 1e-9)


def test_a_weak_magnet_drops_the_payload():
    _, held = lifted("mocap_dropout@9")
    _, weak = lifted("magnet_weak@0.5+0.3")
    assert height(held, 0.99) > height(held, 0.1) - 0.02
    assert height(held, 1.4) < height(held, 0.99) - 0.3  # switched off
    assert height(weak, 0.49) > height(weak, 0.1) - 0.02
    assert height(weak, 0.9) < height(weak, 0.49) - 0.3
    assert not any(truth.magnet_force for t, truth in weak if 0.51 < t < 0.79)


def test_a_magnet_that_does_not_release_keeps_the_payload():
    _, stuck = lifted("magnet_stuck@0.5")
    assert height(stuck, 1.49) > height(stuck, 0.1) - 0.02
    _, never_on = lifted("magnet_stuck@1.1")
    assert height(never_on, 1.49) < height(never_on, 0.99) - 0.3


def test_a_payload_swings_but_stays_until_the_magnet_is_off():
    _, flat = lifted("mocap_dropout@9")
    _, swinging = lifted("payload_swing@0.5:rate=4")

    def tilt(rows, begin, end):
        upright = [
            1.0 - 2.0 * float(np.sum(truth.payload_quaternion[1:3] ** 2))
            for t, truth in rows
            if begin < t < end
        ]
        return np.degrees(np.arccos(np.clip(min(upright), -1.0, 1.0)))

    assert tilt(flat, 0.1, 1.0) < 3.0 and tilt(swinging, 0.1, 0.5) < 3.0
    assert tilt(swinging, 0.5, 1.0) > 10.0
    assert height(swinging, 0.99) > height(swinging, 0.1) - 0.02
    assert height(swinging, 1.4) < height(swinging, 0.99) - 0.3


ANOTHER = "rigid_body_plant:RigidBodyPlant"


def test_faults_of_sensors_and_commands_work_with_the_plant_of_any_engine():
    frozen = read_schedule([f"mocap_freeze@{BEGIN}+{END - BEGIN:g}"], SCENARIO, 1)
    plant = make_plant(*START, frozen, ANOTHER)
    plant.timeline.mission_at(0.0, 0.0, "take-off")
    found = poses(during(run(plant, motors=np.ones(4))))
    assert len(found) > 15 and all(equal(pose[1:], found[0][1:]) for pose in found)
    usual = poses(during(run(make_plant(*START, Schedule(), ANOTHER), motors=np.ones(4))))
    assert not equal(usual[0][1:], usual[-1][1:])


@pytest.mark.parametrize(
    "name", ["motor_loss", "battery_sag", "servo_jam", "magnet_weak", "payload_swing", "wind_gust"]
)
def test_faults_of_the_physics_are_refused_where_the_engine_has_none(name):
    faults = read_schedule([f"{name}@1"], SCENARIO, 1)
    with pytest.raises(FaultError, match=f"fault {name}: plant {ANOTHER} has no faults of the"):
        make_plant(*START, faults, ANOTHER)
    assert isinstance(make_plant(*START, faults), FaultyPlant)

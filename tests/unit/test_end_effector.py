"""Tasks of the end effector: base and arm of the reference have the hand where the task has it.

MuJoCo judges the shipped scenarios; an arm of our own with a yaw joint, a chain of rotations.
"""

import math
import shutil
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.arm.chain import Chain
from uam_control.arm.hand import hands, hinge_angles, reach, stretch, working_posture
from uam_control.mission import Feasibility, load_scenario
from uam_control.mission.motion.flatness import Flyer
from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios import curves
from uam_control.mission.scenarios.curves import Harmonic
from uam_control.mission.scenarios.hand_motion import BEFORE, Task, Unreachable, flat, following
from uam_control.mission.scenarios.scenario import ScenarioError
from uam_control.profiles.profile import default_profile
from uam_control.settings.configuration import path
from uam_control.vehicle import chain_of, load_description

VEHICLES = ("s500_arm", "s500_arm3", "hexa_arm")
DRAG = np.array([0.07, 0.07, 0.09])  # [1/s]
HEADER = "t,x,y,z,yaw"


def swinging_arm():
    """An arm as the T650's: joints about z, -y, -y, z; the tool 0.108 m below the last one."""
    offsets = [[0, 0, -0.042], [0, 0.019, -0.04], [0.024, 0, -0.128], [0.129, -0.02, -0.022]]
    axes = [[0, 0, 1], [0, -1, 0], [0, -1, 0], [0, 0, 1]]
    none, each = np.zeros(3), np.zeros((4, 3))
    return Chain(
        *(np.array(offsets, dtype=float), np.array(axes, dtype=float), np.full(4, 0.15), each),
        *(np.zeros((4, 3, 3)), np.zeros(4), np.zeros(4), np.zeros(4), 3.0, none, np.eye(3)),
        *(1, np.array([0.0, 0.0, -0.108]), np.eye(3), none, none, 0.0, none),
    )


def about(axis, angle):
    """Rotation about a coordinate axis 0..2."""
    c, s = math.cos(angle), math.sin(angle)
    found = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[i, i], found[j, j], found[j, i], found[i, j] = c, c, s, -s
    return found


def tool_of(rows):
    """Place and rotation of the swinging arm's tool, of rows (3, 6 + n): value, rate, ..."""
    force = rows[2, :3] + DRAG * rows[1, :3] + (0.0, 0.0, 9.81)
    up = force / np.linalg.norm(force)
    yaw, q = rows[0, 5], rows[0, 6:]
    left = np.cross(up, [math.cos(yaw), math.sin(yaw), 0.0])  # roll turns about the pitched x axis
    left /= np.linalg.norm(left)
    turn = np.column_stack([np.cross(left, up), left, up])
    place, chain = rows[0, :3].copy(), swinging_arm()
    for offset, axis, angle in zip(chain.offsets, (2, 1, 1, 2), q * (1, -1, -1, 1), strict=True):
        place, turn = place + turn @ offset, turn @ about(axis, angle)
    return place + turn @ chain.hand_place, turn


@settings(max_examples=8)
@given(
    speed=st.floats(0.1, 0.2),
    posture=st.tuples(st.floats(-30, 30), st.floats(20, 30), st.floats(20, 30), st.floats(-30, 30)),
    cycles=st.sampled_from([0.0, 2.0, 4.0]),
)
def test_a_tool_with_four_joints_keeps_place_heading_and_elevation(speed, posture, cycles):
    pose = np.array([0.3, -0.2, 0.9, 0.0, 0.0, 0.0, *np.radians(posture)])
    shape = (*curves.circle(0.5), Harmonic(7, math.radians(15.0), cycles))
    path = curves.follow(shape, curves.steady(1.0, math.pi / speed, 4.0), pose, tangent=True)
    elevation = np.zeros(10)
    elevation[4] = math.radians(20.0)
    task = Task(path.shifted(0.0, elevation), True, True, (0, 2, 3))
    motion = following(task, Flyer(swinging_arm(), 9.81, DRAG))
    assert motion.length == pytest.approx(path.length + 2 * BEFORE)
    for time in np.linspace(0.0, path.length, 23):
        wanted = path.rows(np.array([time]), 2)[:, 0]
        place, turn = tool_of(motion.rows(np.array([time]), 3)[:, 0])
        np.testing.assert_allclose(place, wanted[0, :3], atol=1e-4)
        across = math.atan2(-turn[0, 1], turn[1, 1])
        assert math.sin(across - wanted[0, 5]) == pytest.approx(0.0, abs=1e-3)
        assert math.atan2(turn[2, 0], turn[2, 2]) == pytest.approx(math.radians(20.0), abs=1e-3)
    joint_2 = motion.rows(np.linspace(0.0, path.length, 50), 1)[0, :, 7]
    swing = path.rows(np.linspace(0.0, path.length, 50), 1)[0, :, 7]
    np.testing.assert_allclose(joint_2, swing, atol=2e-5)  # keeps its posture, joint 3 gives way


def hand_in_mujoco(vehicle, rows):
    """World place and heading of the magnet's face, hanging level; rows (3, 6 + n)."""
    model = mujoco.MjModel.from_xml_path(str(vehicle.model))
    data = mujoco.MjData(model)
    drag = np.array(vehicle.numbers["air"]["drag"]) / vehicle.mass
    force = rows[2, :3] + drag * rows[1, :3] + (0.0, 0.0, vehicle.gravity)
    up = force / np.linalg.norm(force)
    left = np.cross(up, [math.cos(rows[0, 5]), math.sin(rows[0, 5]), 0.0])
    left /= np.linalg.norm(left)
    base = model.body("base")
    free = model.jnt_qposadr[base.jntadr[0]]
    data.qpos[free : free + 3] = rows[0, :3]
    turn = np.column_stack([np.cross(left, up), left, up]).ravel()
    mujoco.mju_mat2Quat(data.qpos[free + 3 : free + 7], turn)
    for name, angle in zip(vehicle.joint_names, rows[0, 6:], strict=True):
        data.joint(name).qpos = angle
    pitch = math.atan2(force[:2] @ [math.cos(rows[0, 5]), math.sin(rows[0, 5])], force[2])
    data.joint("magnet_swing").qpos = pitch - rows[0, 6:].sum()
    mujoco.mj_kinematics(model, data)
    face = data.site("magnet_face")
    return face.xpos.copy(), math.atan2(-face.xmat[1], face.xmat[4])


@pytest.mark.parametrize("name", VEHICLES)
def test_the_shipped_circle_is_drawn_by_the_magnets_face(name):
    vehicle = load_description(name)
    scenario = load_scenario("ee_circle_020", vehicle)
    path = scenario.route.path
    # 2 s of the base's begin, 4 s ramp, one lap of 2 pi 0.5 m / 0.2 m/s with half of each ramp
    assert path.length == pytest.approx(2 * 2.0 + math.pi / 0.2 + 4.0)
    for time in (0.0, 5.0, 9.3, 12.0, 17.7, path.length):
        place, heading = hand_in_mujoco(vehicle, path.rows(np.array([time]), 3)[:, 0])
        assert math.hypot(*place[:2]) == pytest.approx(0.5, abs=1e-4)
        assert place[2] == pytest.approx(0.9, abs=1e-4)
        assert math.tan(heading) * place[1] == pytest.approx(-place[0], abs=1e-3)  # along the path
    check = Feasibility(vehicle, default_profile("modular", vehicle).sets["mission"], 0.0)
    assert not check.excesses(scenario)


@pytest.mark.parametrize("name", VEHICLES)
def test_the_hand_holds_while_the_base_flies_its_circle(name):
    vehicle = load_description(name)
    path = load_scenario("ee_hold", vehicle).route.path
    times = np.linspace(0.0, path.length, 41)
    rows = path.rows(times, 3)
    for k in range(len(times)):
        place, _ = hand_in_mujoco(vehicle, rows[:, k])
        np.testing.assert_allclose(place, [0.0, 0.0, 0.9], atol=1e-4)
    low, high = rows[0, :, :2].min(axis=0), rows[0, :, :2].max(axis=0)
    np.testing.assert_allclose(high - low, [0.1, 0.1], atol=2e-3)
    assert np.ptp(rows[0, :, 2]) < 1e-4


def test_an_arm_that_turns_about_the_vertical_holds_its_heading_too():
    vehicle = load_description("t650")
    path = load_scenario("ee_hold", vehicle).route.path
    flown = flat(path, np.linspace(0.0, path.length, 200), Flyer.of(vehicle))
    found = hands(chain_of(vehicle), flown.chi)
    np.testing.assert_allclose(found[:, :3], np.tile([0.0, 0.0, 0.9], (200, 1)), atol=1e-4)
    np.testing.assert_allclose(found[:, 3], 0.0, atol=1e-3)
    assert np.ptp(flown.chi[:, 0]) == pytest.approx(0.1, abs=2e-3)


def test_a_joint_without_room_about_zero_works_about_its_middle():
    """20 to 110 degrees: the posture was looked for at 0, and refused as out of this range."""
    mine = load_description()
    low, high = math.radians(20.0), math.radians(110.0)
    joints = mine.joints[0], replace(mine.joints[1], low=low, high=high)
    motion = load_scenario("ee_circle_020", replace(mine, joints=joints)).route.path
    angles = motion.rows(np.linspace(0.0, motion.length, 100), 1)[:, 0, 7]
    assert low < angles.min() and angles.max() < high


def test_a_hand_that_heads_backward_is_on_its_task(tmp_path):
    """Its frame is turned by half a turn: the base heads against the path, and is solved for."""
    shutil.copytree(path("vehicle/parts"), tmp_path / "parts")
    (tmp_path / "mine.xml").write_text(path("vehicle/s500_arm.xml").read_text())
    magnet = tmp_path / "parts" / "magnet.xml"
    site = '<site name="magnet_face"'
    assert site in magnet.read_text()
    magnet.write_text(magnet.read_text().replace(site, f'{site} euler="0 0 180"'))
    (tmp_path / "mine.yaml").write_text("derives: s500_arm\nmodel: mine.xml\n")
    vehicle = load_description(tmp_path / "mine.yaml")
    motion = load_scenario("ee_circle_020", vehicle).route.path
    heading = load_scenario("ee_circle_020", load_description()).route.path
    turned = motion.rows(np.array([9.0]), 1)[0, 0, 5] - heading.rows(np.array([9.0]), 1)[0, 0, 5]
    assert math.cos(turned) == pytest.approx(-1.0, abs=1e-3)
    hold = load_scenario("ee_hold", vehicle).route.path
    for rows in hold.rows(np.linspace(0.0, hold.length, 41), 3).swapaxes(0, 1):
        np.testing.assert_allclose(hand_in_mujoco(vehicle, rows)[0], [0.0, 0.0, 0.9], atol=1e-4)


def test_a_slower_task_is_solved_anew():
    vehicle = load_description()
    slow = load_scenario("ee_figure8_020", vehicle).slowed(2.0).route.path
    assert slow.length == pytest.approx(2 * 2.0 + 2 * (4.268 / 0.2 + 4.0), abs=1e-2)
    for time in (3.0, 17.0, 31.0):
        place, _ = hand_in_mujoco(vehicle, slow.rows(np.array([time]), 3)[:, 0])
        assert place[2] == pytest.approx(0.9, abs=1e-4)
        # x = 0.7 sin s, y = 0.35 sin 2s: y^2 = x^2 (1 - (x / 0.7)^2)
        assert place[1] ** 2 == pytest.approx(place[0] ** 2 * (1 - (place[0] / 0.7) ** 2), abs=1e-4)


def test_the_length_of_a_lap():
    assert curves.lap_length(curves.circle(0.5)) == pytest.approx(math.pi)
    assert curves.lap_length(curves.lemniscate(1.4, 0.7)) == pytest.approx(4.268, abs=1e-3)


def test_an_arm_of_two_links_works_best_at_a_right_angle():
    chain = chain_of(load_description())
    end = np.full(2, 1.6)
    angles = working_posture(chain, (0.0, 0.3), -end, end)
    assert angles[0] == 0.0
    assert angles[1] == pytest.approx(math.pi / 2, abs=math.radians(3.0))  # steps of 5 degrees
    # a hinge that ends at 60 degrees lets the arm bend so far, also from beyond it on
    for stowed in (0.0, 0.3), (0.0, 1.5):
        bent = working_posture(chain, stowed, -end, end, (-math.pi / 3, math.pi / 3))
        hinge = abs(hinge_angles(chain, bent[None])[0])
        assert math.radians(50.0) < hinge <= math.pi / 3
    # area of the velocities: link 1 x link 2 at a right angle
    assert np.prod(stretch(chain, np.array([0.2, math.pi / 2]))) == pytest.approx(0.1 * 0.14)
    assert reach(chain) == pytest.approx(0.1 + 0.14 + 0.03)


@pytest.mark.parametrize("number", [0, 1])
def test_an_arm_with_a_roll_joint_works_with_a_level_hinge(number):
    """With an upright hinge the hand swings by any angle, and has no heading."""
    chain = chain_of(load_description("s500_arm3"))
    axes = np.array([[0.0, -1.0, 0.0]] * 3)
    axes[number] = 1.0, 0.0, 0.0
    end, rolls = np.full(3, 1.6), chain._replace(axes=axes)
    angles = working_posture(rolls, (0.0, 0.3, 0.3), -end, end)
    assert abs(angles[number]) < math.radians(5.0)  # the axis, along y at zero, rolls with it


def test_a_hand_hangs_level_or_as_its_hinge_stands():
    chain = chain_of(load_description())
    pose = np.array([[1.0, 2.0, 3.0, 0.0, 0.5, 0.0, 0.0, math.pi / 2]])
    pivot = [1 + 0.14 * math.cos(0.5) - 0.173 * math.sin(0.5), 2.0]
    height = 3 - 0.173 * math.cos(0.5) - 0.14 * math.sin(0.5)
    np.testing.assert_allclose(hands(chain, pose), [[*pivot, height - 0.03, 0.0, 0.0]], atol=1e-9)
    # the hinge at 0 continues the last link, which points forward and, with the base, down
    along = [*(pivot + 0.03 * np.array([math.cos(0.5), 0.0])), height - 0.03 * math.sin(0.5)]
    found = hands(chain, pose, np.zeros(1))
    np.testing.assert_allclose(found[0, :3], along, atol=1e-9)


BASE = "base: {kind: circle, radius: 0.05, period: 3.3}"


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("shape: spiral", "'spiral' is not one of circle, ellipse, figure_eight, line, hold, csv"),
        ("shape: circle, radius: 0.5, height: 1, period: 9, at: 3", "at: only with moves"),
        ("shape: circle, height: 1, period: 9", "radius is missing"),
        ("shape: circle, radius: 0.5, height: 1, period: 9, arm_deg: [0, 200]", "alpha_2 from 200"),
        ("shape: circle, radius: 0.5, height: 1, period: 9, sweep: [{joint: alpha_9}]", "alpha_9"),
        (
            "shape: circle, radius: 0.5, height: 1, period: 9, elevation_deg: 10",
            "the arm of s500_arm cannot keep an elevation beside this task",
        ),
        (
            "shape: circle, radius: 0.5, height: 1, mean_speed: 4, ramp: 0.5, "
            "sweep: [{cycles: 9, amplitude_deg: 50}]",
            "slower",
        ),
        ("shape: circle, radius: 1, spin: 1", "spin: unknown; allowed: kind, shape, elevation, "),
        ("shape: hold, position: [0, 0, 0.9]", "base is missing"),
        (f"shape: hold, position: [0, 0, 0.9], {BASE[:-1]}, height: 1}}", "base.height: not of"),
        (
            f"shape: hold, position: [0, 0, 0.9], {BASE.replace('0.05', '0.5')}",
            "off its task at",
        ),
        (
            "shape: hold, position: [0, 0, 0.9], arm_deg: [30, 4], "
            "base: {kind: circle, radius: 0.0001, period: 3.3}",
            "singular at",
        ),
    ],
)
def test_a_bad_entry_is_refused_in_one_line(tmp_path, entry, reason):
    file = tmp_path / "task.yaml"
    file.write_text(f"trajectory: {{kind: end_effector, {entry}}}\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(str(file))
    assert reason in str(caught.value)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_vehicle_without_a_hand_is_refused(monkeypatch):
    monkeypatch.setattr("uam_control.vehicle.chain_reader.HANDS", ("no such site",))
    with pytest.raises(ScenarioError, match="the vehicle has no end effector"):
        load_scenario("ee_circle_010", replace(load_description(), end_effector=""))


def rows_of_csv(elevation=""):
    """A line of 0.4 m in 4 s (minimum jerk), from a rest of 1 s to another; 10 Hz."""
    lines = []
    for k in range(61):
        s = min(max((0.1 * k - 1.0) / 4.0, 0.0), 1.0)
        way = 0.4 * s**3 * (10 - 15 * s + 6 * s * s)
        lines.append(f"{0.1 * k:.1f},{way:.9f},0.1,0.9,0.3{elevation}")
    return lines


@pytest.mark.parametrize("rests", [range(1, 1), [*range(1, 10), *range(51, 60)]])
def test_a_csv_file_of_the_hand(rests, tmp_path):
    """rests: rows left out, of the rests: the two rows around them say as much."""
    rows = [row for number, row in enumerate(rows_of_csv()) if number not in rests]
    (tmp_path / "line.csv").write_text("\n".join([HEADER, *rows]))
    task = tmp_path / "task.yaml"
    task.write_text("trajectory: {kind: end_effector, shape: csv, file: line.csv}\n")
    vehicle = load_description()
    path = load_scenario(str(task)).route.path
    assert path.length == pytest.approx(6.0 + 2 * 2.0)
    place, heading = hand_in_mujoco(vehicle, path.rows(np.array([5.0]), 3)[:, 0])
    # the row of t = 3 s is the middle; within the millimetre of the curve through the rows
    np.testing.assert_allclose(place, [0.2, 0.1, 0.9], atol=1.1e-3)
    assert heading == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize(
    ("header", "lines", "reason"),
    [
        ("t,x,y,z", rows_of_csv(), "line 1: t,x,y,z: columns t,x,y,z,yaw expected"),
        (HEADER, rows_of_csv()[:30], "must be at rest in the first and last row"),
        (HEADER, ["0,0,0,0.9,0", "0,0,0,0.9,0"], "increasing times"),
        (f"{HEADER},elevation", rows_of_csv(",0.1"), "cannot keep an elevation"),
    ],
)
def test_a_bad_csv_file_is_refused(tmp_path, header, lines, reason):
    (tmp_path / "line.csv").write_text("\n".join([header, *lines]))
    task = tmp_path / "task.yaml"
    task.write_text("trajectory: {kind: end_effector, shape: csv, file: line.csv}\n")
    with pytest.raises(ScenarioError, match=reason):
        load_scenario(str(task))


def test_a_task_that_no_motion_meets_says_by_how_much_and_when():
    pose = np.array([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 0.0, math.pi / 2])
    shape = (*curves.circle(0.5), Harmonic(6, 0.5, 9.0))
    path = curves.follow(shape, curves.steady(1.0, math.pi / 5.0, 0.6), pose, tangent=True)
    chain = chain_of(load_description())
    with pytest.raises(Unreachable, match=r"the hand is \d\S* (mm|deg) off its task at \d\.\d s"):
        following(Task(path, False, True, ()), Flyer(chain, 9.81, DRAG))


def test_a_flat_pose_leans_into_its_acceleration():
    knots, powers = np.array([0.0, 1.0]), np.zeros((1, 3, 8))
    powers[0, 2, 0] = 0.5 * 9.81  # x = g t^2 / 2
    flyer = Flyer(chain_of(load_description()), 9.81, np.zeros(3))
    found = flat(Polynomials(knots, powers), np.array([0.5]), flyer)
    assert found.chi[0, 4] == pytest.approx(math.pi / 4)
    np.testing.assert_allclose(found.force, [[9.81, 0.0, 9.81]])

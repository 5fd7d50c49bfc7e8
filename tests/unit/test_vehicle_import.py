"""Import of vehicles: what is found equals the file; what contradicts is refused by line."""

from __future__ import annotations

import errno
import math
import re
import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml
from imported_vehicle import imported, posed, write
from urdf_texts import FINGERS, SECOND_ARM, drone, inertial, joint

from uam_control.arm.hand import hinge_angles
from uam_control.settings.configuration import path
from uam_control.vehicle import chain_of, load_description
from uam_lab.cli.parser import parsed, run
from uam_lab.importing import importer, picture
from uam_lab.importing.answers import Answers, read_answers
from uam_lab.importing.source import ImportRefused
from uam_lab.importing.structure import Chosen
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

VEHICLES = {
    "quad": {},
    "one joint": {"axes": ("0 1 0",)},
    "hexa, yaw first": {"count": 6, "axes": ("0 0 1", "0 1 0", "0 1 0"), "mass": 3.0},
    "coaxial octo, 5 joints": {
        "count": 8,
        "coaxial": True,
        "axes": ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 -1 0"),
        "mass": 6.0,
    },
    "tilted mount": {"mount": "0.3 -0.4 0.7", "axes": ("0 1 0", "1 0 0", "0.6 0.8 0")},
    "small": {"mass": 0.45, "length": 0.06, "axes": ("1 0 0", "0 1 0")},
}


@pytest.mark.parametrize("what", VEHICLES)
def test_the_written_vehicle_is_that_of_the_file(tmp_path, what):
    """Place of the tool and centre of mass of base and arm at random angles, in the base's frame:
    the file as MuJoCo reads it against the vehicle that is written, without its magnet."""
    text = drone(**VEHICLES[what])
    made, model = imported(tmp_path, text)
    names = made.description.joint_names
    free = text.replace("</robot>", '<link name="world"/></robot>')
    floating = (
        '<joint name="f" type="floating"><parent link="world"/><child link="base_link"/></joint>'
    )
    how = '<mujoco><compiler fusestatic="false"/></mujoco>'
    own = mujoco.MjModel.from_xml_string(free.replace("</robot>", f"{floating}{how}</robot>"))
    masses = np.where(model.body_rootid == model.body("base").id, model.body_mass, 0.0)
    masses[model.body("magnet").id] = 0.0
    assert masses.sum() == pytest.approx(own.body_mass.sum(), rel=1e-6)
    random = np.random.default_rng(7)
    for _ in range(5):
        angles = random.uniform(-1.0, 1.0, len(names))
        here, there = posed(model, names, angles), posed(own, names, angles)
        base = here.body("base").xpos
        tool = there.body("tool0").xpos - there.body("base_link").xpos
        assert here.body("magnet").xpos - base == pytest.approx(tool, abs=1e-6)
        centre = masses @ (here.xipos - base) / masses.sum()
        file_centre = there.subtree_com[1] - there.body("base_link").xpos
        assert centre == pytest.approx(file_centre, abs=1e-5)


@pytest.mark.parametrize("what", VEHICLES)
def test_it_stands_on_its_feet(tmp_path, what):
    """Half a second with the motors off and the joints at rest: it neither sinks nor topples."""
    made, _ = imported(tmp_path, drone(**VEHICLES[what]))
    plant = MujocoPlant(Vehicle.of(made.description), 0.0, seed=1)
    rotors, joints = len(made.description.rotors), len(made.description.joints)
    start = plant.truth()
    for _ in range(125):
        plant.step(np.zeros(rotors), np.zeros(joints), False)
    end = plant.truth()
    assert end.state[0, 2] == pytest.approx(start.state[0, 2] - 0.005, abs=0.003)
    assert abs(end.quaternion[0]) > 0.9998


def test_an_arm_whose_meshes_are_missing_is_above_the_feet_and_shown(tmp_path):
    """Without shapes nothing but joints and tool says where the arm is: all above the feet, and a
    bar from each joint to the next place."""
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", drone(), flags=re.DOTALL)
    made, model = imported(tmp_path, text)
    joints = made.description.joint_names
    here = posed(model, joints, [one.stowed for one in made.description.joints])
    feet = min(here.geom(f"foot_{i}").xpos[2] for i in range(1, 5)) - 0.012
    heights = [here.joint(one).xanchor[2] for one in joints] + [here.body("magnet").xpos[2]]
    assert min(heights) - feet >= 0.03 - 1e-6  # clearance of config/import/assumed.yaml
    bars = [g for g in range(model.ngeom) if model.geom_bodyid[g] == model.jnt_bodyid[1]]
    assert [model.geom_type[g] for g in bars] == [mujoco.mjtGeom.mjGEOM_CAPSULE]
    ends = here.joint(joints[0]).xanchor, here.joint(joints[1]).xanchor
    assert here.geom_xpos[bars[0]] == pytest.approx((ends[0] + ends[1]) / 2, abs=1e-6)
    middle, radius = picture.bounds(model, here)
    assert np.linalg.norm(here.body("magnet").xpos - middle) < radius < 1.0


@pytest.mark.parametrize(("count", "told"), [(1, "joints joint_0 ("), (2, "joints (")])
def test_joints_without_limits_are_named(tmp_path, count, told):
    """Of two joints that turn without end; all of them: the list alone."""
    text = re.sub(r'type="revolute"', 'type="continuous"', drone(), count=count)
    made, _ = imported(tmp_path, text)
    assert f"{told}assumed: the file has no limits)" in made.missing


def test_rotors_of_a_coaxial_octocopter_turn_against_each_other(tmp_path):
    made, _ = imported(tmp_path, drone(**VEHICLES["coaxial octo, 5 joints"]))
    above = {}
    for rotor in made.description.rotors:
        above.setdefault(tuple(round(x, 3) for x in rotor.position[:2]), []).append(rotor)
    assert len(above) == 4
    for pair in above.values():
        assert len(pair) == 2 and pair[0].counter_clockwise != pair[1].counter_clockwise
    top = [max(pair, key=lambda one: one.position[2]) for pair in above.values()]
    around = sorted(top, key=lambda one: math.atan2(one.position[1], one.position[0]))
    turns = [one.counter_clockwise for one in around]
    assert turns in ([True, False] * 2, [False, True] * 2)


def test_what_holds_a_rotor_is_none(tmp_path):
    """aerial_gym's vehicles have an arm_motor_0, lying, beside each motor_0."""
    arms = "".join(
        f'<link name="arm_rotor_{i}">{inertial(0.01, 0.05)}</link>'
        + joint(f"arm_{i}", "base_link", f"arm_rotor_{i}", "0 0.09 0.05", "fixed", "1.5708 0 0")
        for i in range(4)
    )
    made, _ = imported(tmp_path, drone().replace("</robot>", f"{arms}</robot>"))
    places = [one.position[:2] for one in made.description.rotors]
    assert [math.hypot(*place) for place in places] == pytest.approx([0.25] * 4, 1e-3)


def test_an_answer_counts_more_than_the_file(tmp_path):
    """Of a file's 8.1 N; a menagerie's multicopter had 200 N per rotor to play with."""
    plugins = "".join(GAZEBO.format(i=i, turn="cw" if i % 2 else "ccw") for i in range(4))
    text = drone().replace("</robot>", f"{plugins}</robot>")
    given = {"rotors.thrust_max": "6.5", "rotors.layout": "quad_x", "rotors.distance": 0.2}
    made, _ = imported(tmp_path, text, answers=Answers({"rotors.thrust_max": "6.5"}))
    assert made.description.rotor.thrust_max == pytest.approx(6.5, rel=1e-4)
    made, _ = imported(tmp_path, text, answers=Answers(given))
    places = [one.position[:2] for one in made.description.rotors]
    assert [math.hypot(*place) for place in places] == pytest.approx([0.2] * 4, 1e-3)


def test_an_answer_of_no_use_is_told(tmp_path):
    made, _ = imported(tmp_path, drone(), answers=Answers({"rotors.distance": 0.2}))
    assert "answer rotors.distance: of no use for this vehicle" in made.missing


def test_three_rotors_are_not_replaced_by_four_of_a_layout(tmp_path):
    """Unless the user asks for one; the fourth is on the place of the third."""
    text = re.sub(
        r'(child link="rotor_)3(.*?xyz)="[^"]*"', r'\g<1>3\2="-0.176777 -0.176777 0.05"', drone()
    )
    with pytest.raises(ImportRefused, match=r"rotors at 3 places: 'rotor_0', .* 4 to 12 are"):
        imported(tmp_path, text)
    made, _ = imported(tmp_path, text, answers=Answers({"rotors.layout": "hexa_x"}))
    assert len(made.description.rotors) == 6


def test_what_is_not_in_the_file_is_assumed_and_says_so(tmp_path):
    """Thrust: twice the weight of 1.5 + 4 × 0.01 + 2 × 0.08 + 0.07 kg, by four: 8.68 N."""
    made, _ = imported(tmp_path, drone())
    assert made.description.mass == pytest.approx(1.77)
    rotor = made.description.rotor
    assert rotor.thrust_max == pytest.approx(2.0 * 1.77 * 9.81 / 4.0, rel=1e-3)
    text = (tmp_path / "out" / "mine.yaml").read_text()
    assert "lag_up: 0.01591  # assumed: by the radius" in text
    assert "range_deg: [-103.13, 108.86], stowed_deg" in text
    assert "# range_deg from the file" in text
    assert any("lag_up: 0.01591 (assumed: by the radius)" in line for line in made.missing)
    assert "missing or assumed:" in (tmp_path / "out" / "mine.txt").read_text()


@pytest.mark.parametrize(
    ("given", "count", "told"),
    [({}, 4, "assumed: layout quad_x"), ({"rotors.layout": "coax_x8"}, 8, "asked: layout coax_x8")],
)
def test_rotors_that_the_file_does_not_have_stand_in_a_layout(tmp_path, given, count, told):
    """0.3 m from the middle; opposite rotors turn alike, those above each other do not."""
    answers = Answers(given | {"rotors.distance": 0.3})
    made, _ = imported(tmp_path, drone(count=0), answers=answers)
    rotors = made.description.rotors
    assert len(rotors) == count
    assert [math.hypot(*one.position[:2]) for one in rotors] == pytest.approx([0.3] * count, 1e-3)
    assert sum(one.counter_clockwise for one in rotors) == count // 2
    text = (tmp_path / "out" / "mine.yaml").read_text()
    assert f"# position {told}; direction {told}" in text


def test_answers_take_the_place_of_assumptions(tmp_path):
    file = write(tmp_path, "rotors: {thrust_max: 9.0}\nservo: XM430-W350\n", "answers.yaml")
    answers = Answers(read_answers(file, ["rotors.lag_up=0.04"]))
    made, _ = imported(tmp_path, drone(), answers=answers)
    described = made.description
    assert described.rotor.thrust_max == pytest.approx(9.0, rel=1e-4)
    assert described.rotor.lag_up == 0.04
    assert described.servos[0].stall_torque == 4.1
    assert "lag_up: 0.04  # asked" in (tmp_path / "out" / "mine.yaml").read_text()


def test_a_person_at_the_terminal_is_asked(tmp_path):
    asked = []

    def ask(what, unit, usual):
        asked.append((what, unit))
        return "12.5" if "full thrust" in what else ""

    made, _ = imported(tmp_path, drone(), answers=Answers(ask=ask))
    assert ("full thrust of one rotor", "N") in asked
    assert made.description.rotor.thrust_max == pytest.approx(12.5, rel=1e-4)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rotors.thrust": 1}, "rotors.thrust: unknown"),
        ({"rotors.thrust_max": "much"}, "rotors.thrust_max: 'much': a number above 0"),
        ({"rotors.curve_factor": 1.5}, "a number above 0, at most 1"),
        ({"servo": "SG90"}, "servo: unknown"),
    ],
)
def test_a_wrong_answer_is_refused(tmp_path, given, said):
    with pytest.raises(ImportRefused) as error:
        imported(tmp_path, drone(), answers=Answers(given))
    assert said in str(error.value)


def test_fingers_are_no_joints_of_the_arm(tmp_path):
    made, model = imported(tmp_path, drone().replace("</robot>", FINGERS))
    assert made.description.joint_names == ("joint_0", "joint_1")
    assert made.description.mass == pytest.approx(1.77 + 0.02)
    assert model.nu == 4 + 2 + 1


def test_a_vehicle_may_have_no_magnet(tmp_path):
    """The tool's place is a site then: 0.06 m below the base, and two links of 0.12 m."""
    made, model = imported(tmp_path, drone(), chosen=Chosen(magnet=False))
    assert made.description.mass == pytest.approx(1.7) and not made.description.has_magnet
    here = posed(model, made.description.joint_names, (0.0, 0.0))
    tool = here.site("end_effector").xpos - here.body("base").xpos
    assert tool == pytest.approx((0.02, 0.0, -0.3))


@pytest.mark.parametrize("axis", ["0 1 0", "0 -1 0"])
def test_the_tool_heads_where_the_base_does(tmp_path, axis):
    """Whatever the sign of the last joint's axis: the tool's y axis points to the left."""
    made, model = imported(tmp_path, drone(axes=("0 1 0", axis)))
    here = posed(model, made.description.joint_names, (0.0, 0.0))
    assert here.body("magnet").xmat[[1, 4, 7]] == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)


def test_an_arm_on_top_is_stowed_so_that_its_magnet_hangs_free(tmp_path):
    """Straight up the magnet would have to turn by 180 degrees; its hinge ends at 150. A site has
    no hinge: straight up is the least motion."""
    made, model = imported(tmp_path, drone(mount=f"{math.pi} 0 0"))
    joints = made.description.joints
    here = posed(model, made.description.joint_names, [one.stowed for one in joints])
    assert here.body("magnet").xmat[8] > math.cos(math.radians(150.0))
    chain = chain_of(made.description)
    turned = np.radians([[60.0, 0.0], [-60.0, 0.0], [30.0, 60.0], [-90.0, -30.0]])
    hinge = np.abs(hinge_angles(chain, turned))  # it hangs to the side to which the arm turns
    assert np.degrees(hinge) == pytest.approx([120.0, 120.0, 90.0, 60.0])
    made, _ = imported(tmp_path, drone(mount=f"{math.pi} 0 0"), chosen=Chosen(magnet=False))
    assert [one.stowed for one in made.description.joints] == [0.0, 0.0]
    with pytest.raises(ImportRefused, match="'joint_0': its magnet can hang straight down in no"):
        imported(tmp_path, drone(mount=f"{math.pi} 0 0", axes=("0 0 1",)))


def test_of_two_arms_one_is_chosen(tmp_path):
    text = drone().replace("</robot>", SECOND_ARM)
    made, _ = imported(tmp_path, text, chosen=Chosen(arm="joint_0"))
    assert made.description.joint_names == ("joint_0", "joint_1")
    assert made.description.mass == pytest.approx(1.77 + 0.1)  # the other one is part of the base


def test_a_base_that_floats_already_stays_one(tmp_path):
    extra = '<link name="map"/>\n' + joint("float", "map", "base_link", "0 0 1", "floating")
    made, _ = imported(tmp_path, drone().replace("</robot>", extra + "</robot>"))
    assert made.found[0].startswith("base: base_link")


def test_a_range_beside_zero_stays(tmp_path):
    """0.5 to 2 rad; the stowed angle lies within."""
    text = drone().replace('lower="-1.8" upper="1.9"', 'lower="0.5" upper="2"', 1)
    made, _ = imported(tmp_path, text)
    first = made.description.joints[0]
    assert (first.low, first.high) == pytest.approx((0.5, 2.0), abs=1e-3)
    assert 0.5 < first.stowed < 2.0


def test_each_joint_may_have_a_servo_of_its_own(tmp_path):
    answers = Answers({"servo": "XM540-W150,XM430-W210"})
    made, model = imported(tmp_path, drone(), answers=answers)
    assert [one.stall_torque for one in made.description.servos] == [7.3, 3.0]
    inertias = model.dof_armature[[model.joint(f"joint_{i}").dofadr[0] for i in range(2)]]
    assert inertias == pytest.approx([0.010 * 7.3 / 3.0, 0.010], rel=1e-3)
    with pytest.raises(ImportRefused, match="one for all, or 2 with commas"):
        imported(tmp_path, drone(), answers=Answers({"servo": "XM430-W210," * 2 + "XM430-W210"}))


def test_an_arm_too_heavy_for_every_servo_is_told(tmp_path):
    made, _ = imported(tmp_path, drone(mass=20.0, length=0.5))
    text = "\n".join(made.missing)
    assert "joint_0: outstretched it needs" in text
    assert "type XM540-W270, the strongest; none holds" in text


def stl(size):
    """A tetrahedron."""
    corners = size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(float(x) for i in face for x in corners[i]), 0)
        for face in faces
    )
    return b"\0" * 80 + struct.pack("<I", len(faces)) + body


def with_mesh(name):
    mesh = f'<visual><geometry><mesh filename="{name}"/></geometry></visual></link>'
    return drone().replace("</link>", mesh, 1)


def test_a_mesh_of_a_package_is_found_copied_and_shown_only(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "hull.stl").write_bytes(stl(0.1))
    _, model = imported(tmp_path, with_mesh("package://drone_description/meshes/hull.stl"))
    assert model.nmesh == 1
    geom = int(np.flatnonzero(model.geom_dataid >= 0)[0])
    assert not model.geom_contype[geom] and not model.geom_conaffinity[geom]
    assert (tmp_path / "out/meshes/mesh_0_hull.stl").is_file()


def test_a_missing_or_strange_mesh_is_named(tmp_path):
    made, _ = imported(tmp_path, with_mesh("package://x/hull.stl"))
    assert any("mesh package://x/hull.stl is missing: not shown" in one for one in made.missing)
    (tmp_path / "hull.dae").write_text("x")
    made, _ = imported(tmp_path, with_mesh("hull.dae"))
    assert any("mesh hull.dae is not read" in one for one in made.missing)
    (tmp_path / "hull.stl").write_bytes(b"no mesh")
    made, _ = imported(tmp_path, with_mesh("hull.stl"))
    assert any("hull.stl is no mesh that MuJoCo reads" in one for one in made.missing)


def test_a_mesh_in_mm_is_refused(tmp_path):
    (tmp_path / "hull.stl").write_bytes(stl(100.0))
    with pytest.raises(ImportRefused, match=r"mine.urdf line \d+: mesh hull.stl is 141.4 m large"):
        imported(tmp_path, with_mesh("hull.stl"))


GAZEBO = """<gazebo><plugin filename="librotors_gazebo_motor_model.so" name="m{i}">
<linkName>rotor_{i}</linkName><turningDirection>{turn}</turningDirection>
<timeConstantUp>0.0125</timeConstantUp><timeConstantDown>0.025</timeConstantDown>
<maxRotVelocity>900</maxRotVelocity><motorConstant>1e-05</motorConstant>
<momentConstant>0.016</momentConstant></plugin></gazebo>
"""


def test_motors_of_gazebo_are_read(tmp_path):
    """1e-5 × 900² = 8.1 N."""
    turns = ("ccw", "cw", "ccw", "cw")
    plugins = "".join(GAZEBO.format(i=i, turn=turn) for i, turn in enumerate(turns))
    made, _ = imported(tmp_path, drone().replace("</robot>", plugins + "</robot>"))
    rotor = made.description.rotor
    assert rotor.thrust_max == pytest.approx(8.1, rel=1e-4)
    assert (rotor.moment_ratio, rotor.lag_up, rotor.lag_down) == (0.016, 0.0125, 0.025)
    turned = tuple(one.counter_clockwise for one in made.description.rotors)
    assert turned == (True, False, True, False)
    assert not any("lag_up" in line for line in made.missing)


@pytest.mark.parametrize(
    "names", [("1", "1e3"), ("no", "null"), ("a, b", "c: #d"), ("[x]", " 'y"), ("!t", "関 節")]
)
def test_joints_keep_names_that_yaml_reads_as_something_else(tmp_path, names):
    text = drone()
    for old, new in zip(("joint_0", "joint_1"), names, strict=True):
        text = text.replace(f'joint name="{old}"', f'joint name="{new}"')
    assert imported(tmp_path, text)[0].description.joint_names == names


def test_a_joint_with_a_name_of_ours_is_refused(tmp_path):
    with pytest.raises(ImportRefused, match=r"joint 'alpha_2': .* scenarios call it alpha_1"):
        imported(tmp_path, drone().replace("joint_0", "alpha_2").replace("joint_1", "alpha_1"))
    with pytest.raises(ImportRefused, match=r"joint 'base': another name is needed"):
        imported(tmp_path, drone().replace("joint_0", "base"))


def test_a_vehicle_of_this_project_comes_back(tmp_path):
    """The hexacopter's MJCF, whose parts stand in other files: same arm, same mass."""
    made = importer.import_vehicle(
        path("vehicle/hexa_arm.xml"), tmp_path, "again", Chosen(), Answers()
    )
    ours = load_description("hexa_arm")
    assert made.description.joint_names == ours.joint_names
    assert made.description.mass == pytest.approx(ours.mass, abs=1e-3)
    angles = (0.3, -0.7)
    tips = []
    for described in (made.description, ours):
        here = posed(Vehicle.of(described).compile(0.0), described.joint_names, angles)
        tips.append(here.body("magnet").xpos - here.body("base").xpos)
    assert tips[0] == pytest.approx(tips[1], abs=1e-6)


def test_a_drone_without_an_arm_gets_that_of_another_vehicle(tmp_path):
    with pytest.raises(
        ImportRefused, match="no arm: no revolute joint hangs on 'base_link'; --arm-of"
    ):
        imported(tmp_path, drone(arm=False))
    other = load_description("s500_arm3")
    made, _ = imported(tmp_path, drone(arm=False), arm_of=other)
    assert made.description.joint_names == other.joint_names
    assert made.description.servos == other.servos
    assert made.description.stowed == pytest.approx(other.stowed)  # where its scenarios begin
    for mine, theirs in zip(made.description.joints, other.joints, strict=True):
        assert (mine.low, mine.high) == pytest.approx((theirs.low, theirs.high), abs=1e-3)


def test_the_command_refuses_in_one_line_with_status_2(tmp_path, capsys):
    file = write(tmp_path, drone().replace('value="0.08"', 'value="-0.08"', 1))
    options = parsed(["vehicle", "import", str(file), "--out", str(tmp_path / "o")])
    assert run(options) == 2
    said = capsys.readouterr().err
    assert said.startswith("uam vehicle: ") and said.count("\n") == 1 and "mine.urdf line" in said


@pytest.mark.parametrize("name", ["../mine", "/mine", "my drone"])
def test_a_name_that_leaves_the_folder_or_the_printed_command_is_refused(tmp_path, capsys, name):
    file, out = write(tmp_path, drone()), tmp_path / "o"
    assert run(parsed(["vehicle", "import", str(file), "--out", str(out), "--name", name])) == 2
    assert "--name: " in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("kind", [".xml", ".yaml", ".txt"])
def test_a_full_disk_leaves_no_part_of_a_file(tmp_path, capsys, monkeypatch, kind):
    file, out = write(tmp_path, drone()), tmp_path / "o"
    whole = Path.write_text

    def until_it_is_full(self, text, **how):
        whole(self, text[:10] if self.suffix == kind else text, **how)
        if self.suffix == kind:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", until_it_is_full)
    assert run(parsed(["vehicle", "import", str(file), "--out", str(out), "--no-questions"])) == 1
    assert f"mine{kind} is not written, no space left on device" in capsys.readouterr().err
    assert not [*out.glob(f"*{kind}"), *out.glob(".*")]


def test_the_command_writes_files_and_a_picture_once(tmp_path, capsys):
    file, out = write(tmp_path, drone()), tmp_path / "o"
    words = ["vehicle", "import", str(file), "--out", str(out), "--no-questions"]
    assert run(parsed(words)) == 0
    told = capsys.readouterr().out
    assert "arm: 2 joints: joint_0, joint_1" in told and "uam vehicle design" in told
    assert yaml.safe_load((out / "mine.yaml").read_text())["model"] == "mine.xml"
    assert run(parsed(words)) == 2
    assert "exists; --overwrite" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [((), "required"), (("s500arm", "a.png"), "unknown vehicle")],
)
def test_a_picture_is_refused_in_one_line(monkeypatch, capsys, given, said):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr("sys.argv", ["picture", *given])
    with pytest.raises(SystemExit) as ended:
        picture.main()
    assert ended.value.code == 2 and said in capsys.readouterr().err.splitlines()[-1]

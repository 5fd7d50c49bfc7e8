"""Import of vehicles from MJCF."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from imported_vehicle import imported, posed
from urdf_texts import drone, inertial

from uam_lab.importing.source import ImportRefused

MJCF = """<mujoco><worldbody><body name="x2" pos="0 0 0.1"><freejoint/>
<geom type="box" size=".1 .1 .03" mass="1.2"/>
<site name="thrust1" pos="-.14 -.18 .05"/><site name="thrust2" pos="-.14 .18 .05"/>
<site name="thrust3" pos=".14 .18 .08"/><site name="thrust4" pos=".14 -.18 .08"/>
<body name="upper" pos="0 0 -.05"><joint name="shoulder" axis="0 1 0" pos="0 0 .01" range="-90 90"/>
<geom type="capsule" fromto="0 0 0 0 0 -.1" size=".01" mass=".1"/>
<site name="gripper_tip" pos="0 0 -.12"/></body></body></worldbody>
<actuator><motor name="a" site="thrust1" gear="0 0 1 0 0 -.02" ctrlrange="0 7"/>
<motor name="b" site="thrust2" gear="0 0 1 0 0 .02" ctrlrange="0 7"/>
<motor name="c" site="thrust3" gear="0 0 1 0 0 -.02" ctrlrange="0 7"/>
<motor name="d" site="thrust4" gear="0 0 1 0 0 .02" ctrlrange="0 7"/></actuator></mujoco>"""


def test_an_mjcf_tells_thrust_and_turns_by_its_actuators(tmp_path):
    """A moment along -z per thrust is that of a counter-clockwise rotor; joint 0.04 m below."""
    made, model = imported(tmp_path, MJCF, "x2.xml")
    rotor = made.description.rotor
    assert rotor.thrust_max == pytest.approx(7.0, rel=1e-4)
    assert rotor.moment_ratio == 0.02
    turned = [one.counter_clockwise for one in made.description.rotors]
    assert turned == [True, False, True, False]
    here = posed(model, ("shoulder",), (0.0,))
    assert here.joint("shoulder").xanchor - here.body("base").xpos == pytest.approx((0, 0, -0.04))
    assert here.body("magnet").xpos - here.body("base").xpos == pytest.approx((0, 0, -0.17))


@pytest.mark.parametrize("inertial", [True, False])
def test_a_missing_mesh_of_an_mjcf_is_left_out_where_the_body_has_its_own_mass(tmp_path, inertial):
    """With its default flags a mesh collides, and makes the mass of a body without one."""
    body = '<body name="x2" pos="0 0 0.1">'
    assert body in MJCF
    mesh = '<asset><mesh name="hull" file="hull.stl"/></asset><worldbody>'
    given = MJCF.replace("<worldbody>", mesh, 1)
    own = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.02"/>' if inertial else ""
    given = given.replace(body, f'{body}{own}<geom type="mesh" mesh="hull"/>', 1)
    if inertial:
        made, _ = imported(tmp_path, given, "x2.xml")
        assert any("hull.stl is missing: not shown" in one for one in made.missing)
    else:
        with pytest.raises(ImportRefused, match=r"x2.xml line \d+: mesh .*hull.stl is missing"):
            imported(tmp_path, given, "x2.xml")


def test_what_collides_is_shown_where_nothing_visible_is(tmp_path):
    """A base whose only shape to look at is invisible, as of a public X2: its box is drawn."""
    unseen = '<geom type="sphere" size=".05" mass="0" contype="0" conaffinity="0" rgba="0 0 0 0"/>'
    given = MJCF.replace("<freejoint/>", f"<freejoint/>{unseen}", 1)
    _, model = imported(tmp_path, given, "x2.xml")
    own = np.flatnonzero(model.geom_bodyid == model.body("base").id)
    boxes = own[model.geom_type[own] == mujoco.mjtGeom.mjGEOM_BOX]
    assert model.geom_size[boxes].tolist() == [[0.1, 0.1, 0.03]]


@pytest.mark.parametrize(("turn", "said"), [("180 0 0", "180"), ("0 20 0", "20"), ("0 0 90", "")])
def test_a_base_whose_z_axis_does_not_point_up_is_refused(tmp_path, turn, said):
    """A frame of x forward, z down would hang the arm on top; a heading is no matter."""
    text = MJCF.replace('pos="0 0 0.1"', f'pos="0 0 0.1" euler="{turn}"', 1)
    if not said:
        imported(tmp_path, text, "x2.xml")
        return
    with pytest.raises(ImportRefused, match=f"body 'x2': its z axis is {said} deg from up"):
        imported(tmp_path, text, "x2.xml")


def test_a_spring_of_an_mjcf_is_named_as_it_is_left_out(tmp_path):
    made, _ = imported(
        tmp_path, MJCF.replace('axis="0 1 0"', 'axis="0 1 0" stiffness="5"'), "x.xml"
    )
    assert any("joint shoulder: its spring is left out" in line for line in made.missing)


def test_a_link_that_ends_at_its_joint_is_refused(tmp_path):
    """The tool, too, is within 10 mm of the last joint: nothing says where the hand points."""
    flat = inertial(0.08, 0.06).replace('xyz="0 0 -0.03"', 'xyz="0 0 0"')
    text = drone(length=0.004, axes=("0 1 0",)).replace(inertial(0.08, 0.06), flat)
    with pytest.raises(ImportRefused, match="no far end: an end effector 10 mm from it is needed"):
        imported(tmp_path, text)


def test_an_mjcf_without_finite_numbers_is_refused_by_line(tmp_path):
    with pytest.raises(ImportRefused, match=r"x2.xml line 5: <body pos='0 0 nan'>: finite numbers"):
        imported(tmp_path, MJCF.replace('pos="0 0 -.05"', 'pos="0 0 nan"'), "x2.xml")


def test_directions_that_make_roll_and_yaw_one_are_not_taken(tmp_path):
    """Both rotors of a side turn alike in this file: neighbours turn against each other then."""
    text = MJCF.replace("0 0 1 0 0 -.02", "left").replace("0 0 1 0 0 .02", "right")
    for old, new in (("left", "-"), ("right", ""), ("left", ""), ("right", "-")):
        text = text.replace(old, f"0 0 1 0 0 {new}.02", 1)
    made, _ = imported(tmp_path, text, "x2.xml")
    turned = [one.counter_clockwise for one in made.description.rotors]
    assert turned in ([True, False] * 2, [False, True] * 2)
    told = "rotors.layout (assumed: neighbours turn in opposite directions, with those of the file"
    assert any(told in line for line in made.missing)


def test_an_error_of_mujoco_names_file_and_line(tmp_path):
    with pytest.raises(ImportRefused, match=r"x2.xml.*line 2"):
        imported(tmp_path, MJCF.replace('type="box"', 'type="bax"'), "x2.xml")

"""Frames of a model that is written here: where its bodies are, and how they turn."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from uam_sim_bridge.plant.frames import box, end_effector, frames, hanging

HALF = math.sqrt(0.5)
MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base" pos="0 0 5">
      <freejoint name="base"/>
      <geom name="case" type="box" size="0.1 0.2 0.3" pos="0.4 0.5 0.6" mass="1"/>
      <body name="shoulder" pos="0.1 0 -0.2" quat="0 0 0 1">
        <geom size="0.01" mass="0.1"/>
        <body name="link" pos="0 0.3 0" quat="0.6 0 0.8 0">
          <joint name="elbow" type="hinge" axis="0 1 0"/>
          <geom size="0.01" mass="0.1"/>
          <body name="hand" pos="0 0 -0.4">
            <site name="claw" pos="0 0 -0.1" quat="0 0 0 1"/>
            <joint name="wrist" type="hinge" axis="1 0 0"/>
            <geom size="0.01" mass="0.1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
""")


def test_the_end_effector_is_a_site_in_the_frame_of_its_body():
    (claw,) = end_effector(MODEL, "claw")
    assert (claw.name, claw.parent, claw.joint) == ("end_effector", "hand", "")
    np.testing.assert_array_equal(claw.position, [0.0, 0.0, -0.1])
    np.testing.assert_array_equal(claw.quaternion, [0.0, 0.0, 0.0, 1.0])
    assert end_effector(MODEL, "") == []


def test_frames_parents_first():
    shoulder, link, hand = frames(MODEL)
    assert (shoulder.name, shoulder.parent, shoulder.joint) == ("shoulder", "base_link", "")
    np.testing.assert_array_equal(shoulder.position, [0.1, 0.0, -0.2])
    np.testing.assert_array_equal(shoulder.quaternion, [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(shoulder.axis, [0.0, 0.0, 0.0])
    assert (link.name, link.parent, link.joint) == ("link", "shoulder", "elbow")
    np.testing.assert_array_equal(link.position, [0.0, 0.3, 0.0])
    np.testing.assert_array_equal(link.axis, [0.0, 1.0, 0.0])
    assert (hand.name, hand.parent, hand.joint) == ("hand", "link", "wrist")
    np.testing.assert_array_equal(hand.axis, [1.0, 0.0, 0.0])


def test_a_joint_turns_about_its_axis_after_the_frame():
    _, link, hand = frames(MODEL)
    # (.6, 0, .8, 0) is a turn of 2 atan(.8/.6) about y; a quarter turn more by (h, 0, h, 0)
    expected = [(0.6 - 0.8) * HALF, 0.0, (0.6 + 0.8) * HALF, 0.0]
    np.testing.assert_allclose(link.moved(math.pi / 2.0)[1], expected, atol=1e-15)
    np.testing.assert_allclose(hand.moved(-math.pi / 2.0)[1], [HALF, -HALF, 0.0, 0.0])


def test_a_box_has_edges_of_twice_its_half_sizes():
    found = box(MODEL, "case")
    np.testing.assert_array_equal(found.centre, [0.4, 0.5, 0.6])
    np.testing.assert_allclose(found.edges, [0.2, 0.4, 0.6])


def test_a_hanging_magnet_takes_back_pitch_and_joints():
    assert hanging(0.5, np.array([0.25, 1.0])) == -0.75
    assert hanging(-0.5, np.array([0.25, 1.0, -2.0])) == 0.25

"""Import of vehicles: what contradicts is refused by line."""

from __future__ import annotations

import pytest
from imported_vehicle import imported, line_of
from urdf_texts import SECOND_ARM, drone, inertial

from uam_lab.importing.source import ImportRefused

POINT, FLAT = (
    '<inertial><mass value="0.08"/>'
    f'<inertia ixx="{x}" iyy="{x}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial>'
    for x, z in ((0, 0), (1e-5, 3e-5))
)
HOSTILE = {  # what is replaced by what → what is said, and the text in whose line it is
    "cycle": ('<child link="tool0"/>', '<child link="arm_0"/>', "link 'arm_0' hangs on", '"tool"'),
    "prismatic": (
        'name="joint_1" type="revolute"',
        'name="joint_1" type="prismatic"',
        "joint 'joint_1': prismatic joint in the arm",
        'name="joint_1"',
    ),
    "planar": ('name="tool" type="fixed"', 'name="tool" type="planer"', "type 'planer'", '"tool"'),
    "negative mass": ('value="0.08"', 'value="-0.08"', "link 'arm_0': mass -0.08 kg", '"arm_0"'),
    "no inertia": (inertial(0.08, 0.06), "", "body 'arm_0': no mass", '"arm_0"'),
    "zero inertia": (inertial(0.08, 0.06), POINT, "is nothing", '"arm_0"'),
    "impossible inertia": (inertial(0.08, 0.06), FLAT, "must satisfy A + B >= C", '"arm_0"'),
    "not a number": ('xyz="0.02 0 -0.06"', 'xyz="0.02 nan -0.06"', "3 finite numbers", "joint_0"),
    "in mm": ('xyz="0.02 0 -0.06"', 'xyz="20 0 -60"', "lengths in mm", '"joint_0"'),
    "duplicate": ('<link name="tool0"/>', '<link name="arm_0"/>', "is there twice", "tool0"),
    "unknown link": ('parent link="arm_1"', 'parent link="arm_9"', "'arm_9' is no link", '"tool"'),
    "two roots": ("</robot>", '<link name="alone"/>\n</robot>', "several roots", ""),
    "axis": ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', "an axis of zeros", '"joint_0"'),
    "limits": ('lower="-1.8"', 'lower="2.8"', "lower 2.8 is above upper 1.9", '"joint_0"'),
    "two arms": ("</robot>", SECOND_ARM, "several arms hang on the base", ""),
    "bomb": ("<robot", '<!DOCTYPE x [<!ENTITY a "b">]>\n<robot', "document type", ""),
    "mass in g": ('<mass value="1.5"/>', '<mass value="1500"/>', "kg: in g?", '"base_link"'),
    "inertia in g mm^2": (
        inertial(0.08, 0.06),
        inertial(0.08, 0.06).replace("e-05", "e+04"),
        "in g mm^2?",
        '"arm_0"',
    ),
    "limit in degrees": ('upper="1.9"', 'upper="109"', "109 rad is over two turns", '"joint_0"'),
    "no value of a mass": ('<mass value="0.08"/>', "<mass/>", "without <mass value>", '"arm_0"'),
    "shape in mm": ('size="0.2 0.2 0.1"', 'size="200 200 100"', "is 300 m large", '"base_link"'),
    "no XML": ("</robot>", "", "no XML", ""),
}  # fmt: skip


@pytest.mark.parametrize("what", HOSTILE)
def test_a_file_that_contradicts_is_refused_by_line(tmp_path, what):
    plain, broken, said, where = HOSTILE[what]
    text = drone()
    assert plain in text
    with pytest.raises(ImportRefused) as error:
        imported(tmp_path, text.replace(plain, broken, 1))
    message = str(error.value)
    assert said in message and "\n" not in message
    if where:
        assert f"mine.urdf line {line_of(text, where)}" in message
    assert not (tmp_path / "out" / "mine.yaml").exists()


def test_a_base_without_mass_is_refused(tmp_path):
    text = drone().replace('<mass value="1.5"/>', '<mass value="0"/>').replace("0.01", "0")
    with pytest.raises(ImportRefused, match="'base_link': no mass|base has no mass"):
        imported(tmp_path, text)


@pytest.mark.parametrize(
    ("name", "made"),
    [("a.urdf.xacro", "a.urdf"), ("a.xacro", "a.urdf"), ("a.urdf", "a_plain.urdf")],
)
def test_another_file_is_refused_with_the_way_to_a_urdf(tmp_path, name, made):
    """The command that is printed does not write over the file that it reads."""
    with pytest.raises(ImportRefused, match="<sdf>: URDF or MJCF expected$"):
        imported(tmp_path, "<sdf version='1.6'/>", name)
    macros = '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="x"/></robot>'
    with pytest.raises(ImportRefused, match=f"xacro macros; xacro {name} > {made} first"):
        imported(tmp_path, macros, name)

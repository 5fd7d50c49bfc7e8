"""URDF texts of flying vehicles with arms, for the tests of the import."""

from __future__ import annotations

import math

ARM = "0 1 0", "0 1 0"  # axes of a planar arm


def inertial(mass, size):
    """A box of `size` m."""
    one = mass * size * size / 6.0
    return (
        f'<inertial><origin xyz="0 0 {-size / 2}" rpy="0 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{one}" ixy="0" ixz="0" iyy="{one}" iyz="0" izz="{one}"/></inertial>'
    )


def box(kind, size, z=0.0):
    return f'<{kind}><origin xyz="0 0 {z}"/><geometry><box size="{size}"/></geometry></{kind}>'


def joint(name, parent, child, xyz, kind="fixed", rpy="0 0 0", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{more}</joint>'
    )


def drone(axes=ARM, count=4, coaxial=False, mount="0 0 0", mass=1.5, length=0.12, arm=True):
    """A vehicle with `count` rotors at 0.25 m and an arm of links of `length` m, below the base."""
    lines = [
        '<robot name="drone">',
        f'<link name="base_link">{inertial(mass, 0.2)}{box("collision", "0.2 0.2 0.1")}</link>',
    ]
    places = count // 2 if coaxial else count
    for i in range(count):
        angle = math.pi / places + 2.0 * math.pi * (i % places) / places
        x, y = 0.25 * math.cos(angle), 0.25 * math.sin(angle)
        z = -0.02 if i >= places else 0.05
        spin = '<axis xyz="0 0 1"/>'
        at = f"{x:.6f} {y:.6f} {z}"
        lines.append(f'<link name="rotor_{i}">{inertial(0.01, 0.05)}</link>')
        lines.append(
            joint(f"rotor_{i}_joint", "base_link", f"rotor_{i}", at, "continuous", more=spin)
        )
    above = "base_link"
    for i, axis in enumerate(axes if arm else ()):
        more = f'<axis xyz="{axis}"/><limit lower="-1.8" upper="1.9" effort="2" velocity="5"/>'
        at, rpy = ("0.02 0 -0.06", mount) if i == 0 else (f"0 0 {-length}", "0 0 0")
        shown = box("visual", "0.02 0.02 0.1", -0.05)
        lines.append(f'<link name="arm_{i}">{inertial(0.08, 0.06)}{shown}</link>')
        lines.append(joint(f"joint_{i}", above, f"arm_{i}", at, "revolute", rpy, more))
        above = f"arm_{i}"
    if arm:
        lines.append('<link name="tool0"/>')
        lines.append(joint("tool", above, "tool0", f"0 0 {-length}"))
    return "\n".join([*lines, "</robot>", ""])


FINGERS = (
    f'<link name="left_finger">{inertial(0.01, 0.02)}</link>\n'
    f'<link name="right_finger">{inertial(0.01, 0.02)}</link>\n'
    + joint("finger_left", "arm_1", "left_finger", "0 0.01 -0.12", "prismatic",
            more='<axis xyz="0 1 0"/><limit lower="0" upper="0.02" effort="1" velocity="1"/>')
    + "\n"
    + joint("finger_right", "arm_1", "right_finger", "0 -0.01 -0.12", "prismatic",
            more='<axis xyz="0 1 0"/><limit lower="0" upper="0.02" effort="1" velocity="1"/>'
            '<mimic joint="finger_left"/>')
    + "\n</robot>"
)  # fmt: skip
SECOND_ARM = (
    f'<link name="other">{inertial(0.1, 0.05)}</link>\n'
    + joint("other_joint", "base_link", "other", "0 0.1 0", "revolute",
            more='<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>')
    + "\n</robot>"
)  # fmt: skip

"""What references need: thrust, tilt, rates and torques by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from uam_control.mission import Feasibility
from uam_control.mission.feasibility import in_words
from uam_control.profiles.profile import load_profile

PROFILE = load_profile("s500")
LIMITS = PROFILE.sets["mission"]
TIMES = np.arange(0.0, 3.0, 0.01)


def checked():
    return Feasibility(PROFILE.vehicle, LIMITS, 0.0)


class Motion:
    """A reference from a function of time that returns value, rate, acceleration (3, 8)."""

    def __init__(self, function):
        self.function = function

    def write(self, time, reference):
        reference[:] = 0.0
        reference[:3] = self.function(time)


def rows(**columns):
    """Reference (3, 8) with z = 1 m and the given columns: name → value, rate, acceleration."""
    names = ("x", "y", "z", "roll", "pitch", "yaw", "alpha_1", "alpha_2")
    found = np.zeros((3, 8))
    found[0, 2] = 1.0
    for name, values in columns.items():
        found[:, names.index(name)] = values
    return found


def test_hover_needs_the_weight():
    demand = checked().needs.along(Motion(lambda t: rows()), TIMES, np.zeros(len(TIMES)))
    np.testing.assert_allclose(demand.thrust, 2.2 * 9.81)
    np.testing.assert_allclose(demand.tilt, 0.0)
    np.testing.assert_allclose(demand.body_rates, 0.0, atol=1e-12)
    np.testing.assert_allclose(demand.joint_torques, 0.0, atol=1e-12)  # both links straight down


def test_a_constant_acceleration_tilts_by_its_ratio_to_gravity():
    motion = Motion(lambda t: rows(x=(0.0, 0.0, 9.81)))
    demand = checked().needs.along(motion, TIMES, np.full(len(TIMES), 0.2))
    np.testing.assert_allclose(demand.tilt, math.pi / 4)
    np.testing.assert_allclose(demand.thrust, 2.4 * 9.81 * math.sqrt(2.0))


@pytest.mark.parametrize(("degrees", "beyond"), [(74.0, 0), (80.0, 1), (-80.0, 1)])
def test_a_magnet_hangs_on_a_hinge_that_turns_by_150_deg(degrees, beyond):
    """Both links by 74 deg turn it by 148, by 80 deg by 160."""
    angle = math.radians(degrees), 0.0, 0.0
    motion = Motion(lambda t: rows(alpha_1=angle, alpha_2=angle))
    demand = checked().needs.along(motion, TIMES, np.zeros(len(TIMES)))
    found = [one for one in checked().exceeded(demand, 0.0) if "hinge" in one.quantity]
    assert len(found) == beyond
    for one in found:
        assert one.value == pytest.approx(-2 * angle[0])
        assert one.limit == pytest.approx(-math.copysign(math.radians(150.0), degrees))


def test_drag_counts():
    motion = Motion(lambda t: rows(y=(0.0, 10.0, 0.0)))
    demand = checked().needs.along(motion, TIMES, np.zeros(len(TIMES)))
    assert demand.tilt[0] == pytest.approx(math.atan(1.5 / (2.2 * 9.81)))


def test_a_steady_circle_turns_the_thrust_about_the_vertical():
    # radius r, rate w: the thrust leans by atan(r w^2 / g) inwards; with yaw fixed the body turns
    # about a horizontal axis: |rates| = w sin(tilt)
    w, r = 2.0, 1.0
    no_drag = replace(
        PROFILE.vehicle, numbers={**PROFILE.vehicle.numbers, "air": {"drag": [0] * 3}}
    )
    motion = Motion(
        lambda t: rows(
            x=(r * math.cos(w * t), -r * w * math.sin(w * t), -r * w * w * math.cos(w * t)),
            y=(r * math.sin(w * t), r * w * math.cos(w * t), -r * w * w * math.sin(w * t)),
        )
    )
    demand = Feasibility(no_drag, LIMITS, 0.0).needs.along(motion, TIMES, np.zeros(len(TIMES)))
    tilt = math.atan(r * w * w / 9.81)
    np.testing.assert_allclose(demand.tilt, tilt)
    inner = demand.body_rates[2:-2]
    # the tip of the unit vector z_b moves with w sin(tilt)
    np.testing.assert_allclose(np.hypot(inner[:, 0], inner[:, 1]), w * math.sin(tilt), rtol=1e-3)


def test_the_change_of_the_body_rates_is_that_of_an_angle_to_and_fro():
    # pitch by a = g tan(A sin wt), straight ahead without drag: its rate changes by A w^2 sin wt,
    # over 0.04 s less by sin(0.02 w) / (0.02 w)
    size, w = 0.3, 5.0

    def ahead(t):
        angle = size * math.sin(w * t)
        return rows(x=(0.0, 0.0, 9.81 * math.tan(angle)))

    air = PROFILE.vehicle.numbers | {"air": {"drag": [0] * 3}}
    still = Feasibility(replace(PROFILE.vehicle, numbers=air), LIMITS, 0.0)
    turn = still.needs.along(Motion(ahead), TIMES, np.zeros(len(TIMES))).turn
    expected = size * w**2 * np.abs(np.sin(w * TIMES)) * math.sin(0.02 * w) / (0.02 * w)
    np.testing.assert_allclose(turn[5:-5], expected[5:-5], rtol=2e-3, atol=1e-2)


def test_joint_torques_of_a_still_arm_are_those_of_its_weight():
    still = Motion(lambda t: rows(alpha_1=(math.pi / 2, 0, 0)))  # both links horizontal, forward
    demand = checked().needs.along(still, TIMES, np.full(len(TIMES), 0.2))
    # link 1: 0.177 kg at 74.5 mm; link 2: 0.09 kg at 75 mm and the magnet, 0.07 kg, at its pivot,
    # 140 mm, both 100 mm further; payload at 240 mm from joint 1
    first = 9.81 * (0.177 * 0.0745 + 0.09 * 0.175 + 0.07 * 0.240 + 0.2 * 0.240)
    second = 9.81 * (0.09 * 0.075 + 0.07 * 0.140 + 0.2 * 0.140)
    np.testing.assert_allclose(demand.joint_torques[100], [first, second], rtol=2e-3)


def test_the_torque_about_yaw_turns_vehicle_arm_and_payload():
    """4 rad/s^2 with both links down: 0.025 kg m^2 of the body and little of the rest. Links and
    0.2 kg held forward, horizontally: each mass by the square of its distance more."""
    lying = (math.pi / 2, 0.0, 0.0)
    down, empty, loaded = (
        checked().needs.along(
            Motion(lambda t, one=one: rows(yaw=(2 * t * t, 4 * t, 4.0), **one)), TIMES, mass
        )
        for one, mass in (
            ({}, np.zeros(len(TIMES))),
            ({"alpha_1": lying}, np.zeros(len(TIMES))),
            ({"alpha_1": lying}, np.full(len(TIMES), 0.2)),
        )
    )
    assert 4.0 * 0.025 < down.yaw_torque[100] < 4.0 * 0.0265
    more = loaded.yaw_torque - empty.yaw_torque
    np.testing.assert_allclose(more, 4.0 * 0.2 * 0.240**2, rtol=1e-6)
    links = 0.177 * 0.0745**2 + 0.09 * 0.175**2 + 0.07 * 0.240**2
    assert empty.yaw_torque[100] - down.yaw_torque[100] == pytest.approx(4.0 * links, rel=0.2)


def test_the_magnet_must_hold_the_payloads_apparent_weight():
    """0.2 kg at 10 m/s^2 upwards weigh 3.96 N; a magnet of 3 N is refused."""
    up = Motion(lambda t: rows(z=(5.0 * t * t, 10.0 * t, 10.0)))
    demand = checked().needs.along(up, TIMES, np.full(len(TIMES), 0.2))
    np.testing.assert_allclose(demand.magnet_force[5:-5], 0.2 * 19.81, rtol=1e-3)
    found = checked().exceeded(demand)
    assert "force on the magnet" not in in_words(found)
    numbers = PROFILE.vehicle.numbers | {"magnet": {"holding_force": 3.0, "gap_scale": 0.003}}
    weak = Feasibility(replace(PROFILE.vehicle, numbers=numbers), LIMITS, 0.2)
    assert "force on the magnet 3.96 N exceeds 3 N" in in_words(weak.exceeded(demand))

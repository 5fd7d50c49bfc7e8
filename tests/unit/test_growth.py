"""benchmarks/growth.py: derived vehicles are whole and hover; table and curves."""

import numpy as np
import pytest
from growing import curves
from growing.flights import DIRECT, Point
from growing.further_recorder import CHOSEN
from growing.vehicles import with_joints, with_rotors

from uam_control.arm.kinematics import DOWN, hand_pose
from uam_control.coordinates import ARM, POSITION
from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.vehicle import chain_of, load_description
from uam_lab.flights.direct.flight import DirectFlight
from uam_msgs_py.messages import topics
from uam_sim_bridge.plant import Vehicle


@pytest.mark.parametrize("count", [2, 3, 6])
def test_a_vehicle_has_the_joints(tmp_path, count):
    described = load_description(with_joints(count, tmp_path))
    assert len(described.joint_names) == count
    reach, _ = hand_pose(chain_of(described), np.zeros(count), DOWN)
    assert -reach[2] == pytest.approx(0.073 + 0.24 + 0.03, abs=0.03)  # mount, links, magnet


@pytest.mark.parametrize("count", [4, 6, 8])
def test_a_vehicle_has_the_rotors_and_their_thrust(tmp_path, count):
    described = load_description(with_rotors(count, tmp_path))
    assert len(described.rotors) == count
    if count == 8:
        hexacopter = load_description("hexa_arm")
        thrust = [len(one.rotors) * one.rotor.thrust_max for one in (described, hexacopter)]
        assert thrust[0] == pytest.approx(thrust[1])


@pytest.mark.parametrize("make, count", [(with_joints, 6), (with_rotors, 8)])
def test_a_derived_vehicle_hovers(tmp_path, make, count):
    described = load_description(make(count, tmp_path))
    profile = default_profile("modular", described)  # as the nodes do
    scenario = load_scenario("hover", described)
    flight = DirectFlight(scenario, profile, Vehicle.of(described), 0.0, seed=1)
    while flight.mission.output.time < 8.0:
        flight.tick()
    state = flight.plant.truth().state[0]
    assert not flight.mission.output.abort_reason
    np.testing.assert_allclose(state[POSITION], [0.0, 0.0, 1.0], atol=0.05)
    assert len(state[ARM]) == len(described.joint_names)


POINTS = [
    Point("joints", 2, "separate", 500.0, 60.0, 12.0),
    Point("joints", 6, "separate", 400.0, 66.0, 15.5),
    Point("joints", 2, DIRECT, 6000.0, np.nan, np.nan),
    Point("joints", 6, DIRECT, 3000.0, np.nan, np.nan),
]


def test_the_table_relates_each_point_to_the_first_of_its_curve():
    lines = curves.table(POINTS).splitlines()
    assert lines[3] == "| joints | 6 | separate | 400 | 0.80 | 66 | 15.5 |"
    assert lines[5] == "| joints | 6 | direct | 3000 | 0.50 | - | - |"


def test_curves_are_drawn(tmp_path):
    curves.draw(POINTS, tmp_path / "growth.png", tmp_path / "growth.svg")
    assert (tmp_path / "growth.png").stat().st_size > 10_000
    assert "<svg" in (tmp_path / "growth.svg").read_text()


def test_axes_show_the_points_of_every_column(monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr(curves.style, "save", lambda figure, file: drawn.append(figure))
    more = Point("vehicles", 2, "separate", 900.0, 3000.0, 15.5)
    curves.draw([*POINTS, more], tmp_path / "growth.png")
    assert drawn[0].axes[0].get_ylim()[1] > 900.0
    assert all(axis.dataLim.y1 <= axis.get_ylim()[1] for axis in drawn[0].axes)


def test_a_further_recorder_begins_with_the_topics_of_every_tick():
    assert set(CHOSEN) == set(topics.RECORDED)
    assert topics.STATE in CHOSEN[:10] and len(CHOSEN) >= 40

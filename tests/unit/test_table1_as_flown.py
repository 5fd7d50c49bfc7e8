"""The profile of Table I as its authors probably flew it: the table's numbers, and the servos."""

from __future__ import annotations

import pytest

from uam_control.profiles.profile import CONTROLLERS, load_profile, servo_mode
from uam_lab.flight.flight_settings import settings
from uam_sim_bridge.faults import FaultError
from uam_sim_bridge.plant import Vehicle

NAME = "paper_table1_as_flown"
TABLE = (
    *("inertia", "lambda_1", "lambda_2", "lambda_table", "q_position", "q_velocity"),
    *("k_initial", "zeta_initial", "nu", "epsilon", "varpi"),
)


@pytest.mark.parametrize("node", CONTROLLERS)
def test_the_numbers_of_the_table_are_those_of_the_verbatim_profile(node):
    table, flown = (load_profile(name).sets[node] for name in ("paper_table1", NAME))
    assert {n: getattr(flown, n) for n in TABLE} == {n: getattr(table, n) for n in TABLE}
    assert flown.safeguards == []


def test_the_servos_take_the_mode_that_the_arms_setpoints_need():
    plain = Vehicle.load()
    assert plain.numbers["servos"]["mode"] == "current"
    assert servo_mode(load_profile("s500")) == {"servos.mode": "current"}
    changed = plain.changed(servo_mode(load_profile(NAME)))
    assert changed.numbers["servos"]["mode"] == "position"


def test_a_fault_of_torque_commands_is_refused_with_goal_positions():
    with pytest.raises(FaultError, match="servo_weak: .*goal positions"):
        settings(profile=NAME, faults=["servo_weak@10:joint=1"], engine="direct")

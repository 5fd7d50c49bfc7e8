"""The profile of Table I as its authors probably flew it: the table's numbers, and the servos."""

from __future__ import annotations

import numpy as np
import pytest
from table1_flights import flights, table

from uam_control.profiles.profile import CONTROLLERS, load_profile, servo_mode
from uam_lab.experiments.compare import plan
from uam_lab.flights.flight_settings import settings
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


def test_it_is_a_row_of_the_comparison():
    ((label, profile),) = plan.entries(["table1_flown"]).items()
    assert (label, profile.name) == ("Table I as probably flown", NAME)


def test_a_fault_of_torque_commands_is_refused_with_goal_positions():
    with pytest.raises(FaultError, match="servo_weak: .*goal positions"):
        settings(profile=NAME, faults=["servo_weak@10:joint=1"], engine="direct")


def test_a_row_is_close_within_a_factor_of_two_of_the_papers():
    row = flights.Row("", "a row", load_profile(NAME))
    rms = np.array(
        [[0.1, 0.01, 0.5, 3.0, 2.0, 3.0, 2.0, 1.0], [0.1, 0.01, 0.5, 3.0, 2.0, 3.0, 2.0, 7.0]]
    )
    one = table.Flown(row, rms, ("completed", "lost"))
    # root mean square of 1 and 7 is 5; x exactly 2, y exactly 1/2 of the paper's
    assert one.mean[7] == pytest.approx(5.0)
    np.testing.assert_allclose(one.ratios[:3], [2.0, 0.5, 0.5 / 0.09])
    assert (one.close, one.completed) == (6, "1 of 2")


def test_every_reading_changes_one_assumption_of_a_valid_profile():
    rows, own = flights.sensitivity(), load_profile(NAME)
    assert len(rows) > 20 and len({row.label + row.group for row in rows}) == len(rows)
    for row in rows:
        assert row.profile.sections != own.sections or row.vehicle
        Vehicle.load().changed(row.vehicle)  # the entries exist


def test_the_mission_is_feasible_with_its_unit_mass():
    assert settings(profile=NAME, engine="direct").profile.name == NAME

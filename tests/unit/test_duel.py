"""`uam duel`: its file, its tables, and the published gains in its profiles."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import load_description
from uam_lab.experiments.duel import flights
from uam_lab.experiments.duel.flights import DuelResult, judged, load_duel, standing, trials

NAN = math.nan
PROFILES = configuration.path("profiles/fsc_geo_l1.yaml").parent


def result(scenario="a", seed=1, delay=0.0, hand=NAN, standing=NAN, outcome="completed", **pick):
    errors = hand, 2 * hand, 0.5, 1.5, standing
    return DuelResult("law", scenario, seed, delay, *errors, outcome, **pick)


def test_a_cell_is_the_mean_of_the_completed_flights_beside_the_published_figure():
    flown = [result(hand=0.010), result(seed=2, hand=0.014), result(seed=3, outcome="lost")]
    flown += [result("hover", standing=0.002), result("hover", delay=20.0)]
    flown += [result("hover", delay=40.0, outcome="lost"), result("hover", delay=60.0)]
    duel = SimpleNamespace(
        rows=["law"],
        scenarios=["a"],
        loads={"a": 0.0},
        published={"law": {"a": (11.0, 9.0, 1.0)}, "other": {"a": (5.0, 6.0, 7.0)}},
    )
    text = flights.tables(duel, flown)
    assert "| law | 12.0 (11) |" in text and "| law | 24.0 (9) |" in text
    assert "| other | - (5) |" in text
    # worst joint, offset 2 mm, 20 ms survived as 40 was not, 1 of 4 flights ended early, lost
    assert "| law | 1.50 | 2.0 | 20 | 1 of 4 | 1 |" in text


def test_a_pick_has_its_means_beside_the_published_figures_and_its_worst():
    """Platform: twice the hand; the payload 10 and 4 mm off; the third flight drops it."""
    flown = [
        result(hand=0.006, largest=0.044, lift=0.03, set_down=0.044, rho=0.12, placed=0.010),
        result(seed=2, hand=0.004, largest=0.036, lift=0.036, set_down=0.02, rho=0.1, placed=0.004),
        result(seed=3, outcome="landed"),
    ]
    duel = SimpleNamespace(
        rows=["law"],
        loads={"a": 0.2},
        scenarios=["a"],
        published={"law": {"a": (28.0, 26.0, 146.0, 24.0)}},
    )
    text = flights.tables(duel, flown)
    cells = "| law | 5.0 (28) | 10.0 (26) | 40 (146) | 7.0 (24) | 10.0 | 36 | 44 | 0.12 |"
    assert cells in text and "| law | 1.50 | - |  | 1 of 3 | 0 |" in text


@pytest.mark.parametrize(("ends", "said"), [("cc", "40 or more"), ("lc", "0"), ("", "")])
def test_a_delay_is_survived_up_to_the_first_that_is_not(ends, said):
    outcomes = {"c": "completed", "l": "lost"}
    flown = [result(delay=20.0 * (i + 1), outcome=outcomes[e]) for i, e in enumerate(ends)]
    assert flights.survived(flown, "law") == said


def test_standing_is_the_mean_error_in_the_second_half_of_the_longest_phase():
    phase = np.array(["up"] * 2 + ["hover"] * 4)
    error = np.array([9.0, 9.0, 9.0, 9.0, 1.0, 3.0])
    series = SimpleNamespace(
        flown=np.ones(6, dtype=bool),
        phase_spans=lambda: [("up", 0, 2), ("hover", 2, 6)],
        in_phase=lambda name: phase == name,
        block=lambda name: np.outer(error, [0.6, 0.0, 0.8, 5.0]),
    )
    assert standing(series) == pytest.approx(2.0)


@pytest.mark.parametrize(("source", "spared"), [("a hand's task", 2.1), (None, 0.0)])
def test_a_task_of_the_hand_is_judged_while_the_hand_is_under_way(source, spared):
    """10 s from 5 s on: of the hand's task without the 2 s of the base alone and 0.1 s."""
    time = np.arange(0.0, 20.0, 0.05)
    on = (time >= 5.0) & (time <= 15.0)
    phase = np.where(on, "trajectory", "transit")
    series = SimpleNamespace(time=time, flown=time >= 1.0, in_phase=lambda name: phase == name)
    rows = judged(series, SimpleNamespace(route=SimpleNamespace(source=source)))
    assert time[rows][[0, -1]] == pytest.approx([5.0 + spared, 15.0 - spared], abs=0.051)


def test_the_shipped_duel_flies_every_row_in_every_task():
    duel = load_duel("fsc_lab", ("default", "MAC"))
    planned = list(trials(duel, 2))
    assert len(planned) == 2 * (7 * 2 + len(duel.delays))
    # the supervisor would land before the law fails
    assert all(
        (one.profile.sets["mission"].delay_margin == 1.0) == bool(one.faults) for one in planned
    )
    assert {one.label for one in planned} == {"default", "MAC"}
    assert all(one.vehicle_changes for one in planned)


def test_the_pick_is_flown_with_its_basket_and_without_a_hover():
    planned = list(trials(load_duel("pillars"), 2))
    assert {one.label for one in planned} == {"default", "default, hand"} and len(planned) == 4
    assert all((one.scenario, one.payload_mass) == ("pillars", 0.2) for one in planned)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rows": {"a": {"law": "pid"}}}, "pid"),
        ({"published": {"MAC": {"ee_circle_099": [1, 2, 3]}}}, "ee_circle_099"),
        ({"published": {"MAC": {"ee_circle_010": [1, 2]}}}, "ee_circle_010"),
        ({"delays_ms": 12}, "delays_ms"),
        ({"delays_ms": [12, "late"]}, "delays_ms"),
        ({"seeds": 0}, "seeds"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, change, said):
    document = yaml.safe_load(configuration.path("duel/fsc_lab.yaml").read_text())
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(document | change))
    with pytest.raises(ConfigurationError, match=said) as found:
        load_duel(str(file))
    assert "\n" not in str(found.value)


def test_a_duel_without_published_figures_has_those_flown_alone(tmp_path):
    document = yaml.safe_load(configuration.path("duel/pillars.yaml").read_text())
    document.pop("published", None)
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(document))
    assert load_duel(str(file)).published == {}


def test_an_unknown_row_is_refused():
    with pytest.raises(ConfigurationError, match="no such row"):
        load_duel("fsc_lab", ("nobody",))


def test_geometric_l1_has_the_published_stiffness_and_damping():
    vehicle = load_description("t650")
    sections = yaml.safe_load((PROFILES / "fsc_geo_l1.yaml").read_text())
    for node, stiffness, damping in (
        ("position_controller", [20.11, 20.11, 13.5], [11.05, 11.05, 10.82]),
        ("attitude_controller", [3.337, 3.337, 1.737], [0.9505, 0.9505, 0.4105]),
        ("arm_controller", [3.0] * 4, [0.25] * 4),
    ):
        one = sections[node]["ros__parameters"]
        inertia = np.array(one["inertia"])
        np.testing.assert_allclose(inertia * one["lambda_1"], stiffness, rtol=1e-3)
        np.testing.assert_allclose(inertia * one["lambda_2"], damping, rtol=1e-3)
    assert load_profile("t650", "fsc_mac", vehicle=vehicle).bridge()["setpoint"] == "wrench"

"""Tables of the comparison, worked by hand."""

import numpy as np
import pytest

from uam_control.profiles.profile import default_profile
from uam_control.vehicle import load_description
from uam_lab.experiments.compare import comparison_report, modularity, plan, tables
from uam_lab.experiments.compare.plan import ASMC1, ASMC2, FROZEN, PROPOSED, entries
from uam_lab.experiments.trials.trial import Trial, TrialResult


def flight(label, seed, rms, mass=0.2, outcome="completed"):
    why = "" if outcome == "completed" else "fell"
    return TrialResult(
        label,
        mass,
        seed,
        np.full(8, float(rms)),
        np.full(8, float(rms)),
        1.0,
        outcome == "lost",
        outcome,
        why,
        0.0,
        (0.0, 0.0),
        {},
    )


def test_a_row_is_the_mean_with_students_interval_over_seeds():
    # seeds' means: (1 + 3) / 2 = 2, (3 + 5) / 2 = 4, (5 + 7) / 2 = 6; s = 2, t(0.975, 2) = 4.3027
    flights = [
        flight(PROPOSED, seed, 2 * seed + k, mass)
        for seed in (1, 2, 3)
        for k, mass in ((-1, 0.1), (1, 0.3))
    ]
    (row,) = tables.rows(flights)
    assert row.mean[0] == pytest.approx(4.0) and row.worst[7] == pytest.approx(7.0)
    assert row.half_width[0] == pytest.approx(4.3027 * 2.0 / np.sqrt(3.0), rel=1e-4)
    assert np.isnan(tables.rows(flights[:2])[0].half_width).all()


def test_a_flight_without_take_off_does_not_count_and_is_told():
    grounded = flight(PROPOSED, 3, np.nan, outcome="refused")
    flights = [flight(PROPOSED, 1, 0.01), flight(PROPOSED, 2, 0.02), grounded]
    row, other, never = tables.rows(
        [*flights, *(flight(ASMC1, s, 3.0) for s in (1, 2)), flight(ASMC2, 1, np.nan, 0.2, "lost")]
    )
    assert (row.flown, row.seeds, row.mean[0]) == (2, 2, pytest.approx(0.015))
    assert row.half_width[0] > 0.0 and row.worst[0] == 0.02
    assert row.shortfall == "1 of 3 not completed, 1 of them without take-off: no errors"
    said = " ".join(tables.claims([row, other, never]))
    assert "One seed only" not in said and "no significant difference" not in said
    assert f"with {PROPOSED} than with {ASMC2}: holds in no column; unknown for x, y" in said
    assert "| - | - | - |" in tables.as_markdown([row, other, never])
    assert "nan" not in tables.as_markdown([row, other, never])
    said = tables.claims(tables.rows([*flights, flight(ASMC1, 1, 3.0)]))
    assert said[0] == f"One seed only, without a confidence interval: {ASMC1}."


def test_a_report_without_the_papers_rows_overlays_the_first_ones(tmp_path, make_flight):
    series = tmp_path / "series.parquet"
    make_flight().write(series)
    trial = Trial(FROZEN, default_profile("modular"), 0.2, 1, keep=series)
    modular = modularity.claim({}), modularity.tables({}, (flight(FROZEN, 1, 0.1),))
    facts = dict.fromkeys(("vehicle", "scenario", "command"), "x")
    facts |= {"payloads_kg": (0.2,), "seeds": (1,), "profiles": {}, "budgets": {}}
    results = [flight(FROZEN, 1, 0.1)]
    _, page = comparison_report.write(tmp_path, [trial], results, modular, facts)
    assert f"overlaid: {FROZEN}." in page.read_text()
    assert (tmp_path / "figures" / "position_errors.png").exists()


def test_the_flights_of_the_modularity_have_the_effects_of_the_plant(tmp_path):
    effects = {"downwash": True}
    flights = plan.Flights(load_description(), "hover", (0.2,), (1,), effects=effects)
    made = modularity.trials(default_profile("modular"), flights, tmp_path / "kept.parquet")
    assert [one.vehicle_changes for one in made] == 4 * [{"effects": effects}]


def test_degradation_is_the_papers():
    # Table II, x: ASMC-1 0.15, proposed 0.05: 66.6 %
    paper = tables.degradation(tables.PAPER[ASMC1], tables.PAPER[PROPOSED])
    assert paper[0] == pytest.approx(66.67, abs=0.01)
    assert paper[3] == pytest.approx(47.99, abs=0.01)


def test_claims_list_the_cases_where_they_hold_and_where_not():
    flights = [flight(ASMC1, s, 3.0 + 0.01 * s) for s in (1, 2, 3)]
    flights += [flight(ASMC2, s, 0.02 + 0.001 * s) for s in (1, 3)]
    flights += [flight(ASMC2, 2, 0.022, outcome="lost")]
    flights += [flight(PROPOSED, s, 0.03 + 0.001 * s) for s in (1, 2, 3)]
    first, second, third, limit, aim, lost, kept = tables.claims(tables.rows(flights))
    assert f"than with {ASMC1}: holds for x, y" in first and "does not" not in first
    assert "holds in no column; does not hold for x" in second
    assert f"with {ASMC2} than with {ASMC1}: holds for x" in third
    assert "missed in y" in limit and "missed in x, y" in aim
    assert lost == f"{ASMC2}: 1 of 3 not completed, 1 of them lost (fell)."
    assert kept == f"{PROPOSED}: all 3 flights completed, none lost."
    assert tables.claims(tables.rows(flights[6:])) == [limit, aim, kept]


def test_the_tables_have_our_figures_the_papers_and_the_degradation():
    text = tables.as_markdown(tables.rows([flight(ASMC1, 1, 0.4), flight(PROPOSED, 1, 0.1)]))
    position, attitude, arm = text.strip().split("\n\n")
    assert "| ASMC-1 (reconstructed) | 0.4000 | 0.4000 | 0.4000 | 0.15 | 0.08 | 0.31 | 75 |" in (
        position
    )
    assert "RMS attitude error [deg]" in attitude and "alpha_2" in arm


def test_a_row_freezes_one_subsystem_or_all():
    arm, every = entries(("frozen_arm", "frozen")).values()
    nodes = ("position_controller", "attitude_controller", "arm_controller")
    assert [arm.sets[node].adapt for node in nodes] == [True, True, False]
    assert [every.sets[node].adapt for node in nodes] == [False] * 3

"""A study: equal feedback and margins by construction, shares, cost, kept results."""

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from adapting import design, report
from adapting.description import StudyError, load_study
from adapting.flights import FLOWN, StudyResult
from adapting.run import FILE, Runner
from adapting.search import cost, search

from uam_control.laws import catalogue
from uam_control.laws.law import LawInputs
from uam_control.mission import load_scenario
from uam_lab.experiments.trials import experiment
from uam_lab.experiments.workers.place import Workplace
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.ros import node_arguments
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.ports import ports_of

STEP = 1e-6
INTEGRATORS = {f"MC_{axis}RATE_I": 0.0 for axis in ("ROLL", "PITCH", "YAW")}
LAWS = (
    "PD",
    "proposed",
    "ASMC-1 (reconstructed)",
    "ASMC-2 (reconstructed)",
    "PD to the same margin",
)


@pytest.fixture(scope="module")
def study():
    return load_study()


def slopes(p, gains):
    """Change of tau by e and by e_dot of each axis alone, at zero error with these gains."""
    law = catalogue.law(p.law)(p)
    n = len(p.inertia)
    memory = np.zeros_like(law.adaptation)
    memory[: len(gains)] = gains

    def tau(e, e_dot):
        inputs = LawInputs(e, e_dot, np.zeros(n), np.zeros(3), False, True, 0.004)
        out = np.zeros(n)
        type(law).step(p.record(), inputs, memory.copy(), out)
        return out

    zero = np.zeros(n)
    by_e = [(tau(d, zero) - tau(-d, zero))[i] / (2 * STEP) for i, d in enumerate(STEP * np.eye(n))]
    by_rate = [
        (tau(zero, d) - tau(zero, -d))[i] / (2 * STEP) for i, d in enumerate(STEP * np.eye(n))
    ]
    return -np.array(by_e), -np.array(by_rate)


@pytest.mark.parametrize("label", LAWS[:4])
@pytest.mark.parametrize("subsystem", SUBSYSTEMS)
def test_every_law_has_the_same_feedback_at_zero_adaptation(study, label, subsystem):
    row = next(one for one in study.rows if one.label == label)
    made = design.profile(study, row, study.document["strengths"])
    p = made.sets[f"{subsystem}_controller"]
    w = np.array(study.document["feedback"][subsystem]["bandwidth"])
    inertia = np.array(study.document["feedback"][subsystem]["inertia"])
    by_e, by_rate = slopes(p, [])
    np.testing.assert_allclose(by_e, inertia * w**2, rtol=1e-6)
    np.testing.assert_allclose(by_rate, inertia * 2.0 * w, rtol=1e-6)


@pytest.mark.parametrize("subsystem", SUBSYSTEMS)
def test_pd_to_the_same_margin_has_the_gains_of_the_law_at_its_ceilings(study, subsystem):
    strength = study.document["strengths"]
    made = {
        one.label: design.profile(study, one, strength)
        for one in study.rows
        if one.label in ("proposed", "PD to the same margin")
    }
    gains = design.largest_gains(made["proposed"])[subsystem]
    node = f"{subsystem}_controller"
    full = slopes(made["proposed"].sets[node], gains)
    stiff = slopes(made["PD to the same margin"].sets[node], [])
    np.testing.assert_allclose(full, stiff, rtol=1e-5)
    w = np.array(study.document["feedback"][subsystem]["bandwidth"])
    inertia = np.array(study.document["feedback"][subsystem]["inertia"])
    g = strength["modular"][subsystem]
    np.testing.assert_allclose(stiff[0], (1.0 + g) * inertia * w**2, rtol=1e-6)


def test_the_strengths_leave_the_stated_margins(study):
    from adapting.run import margins

    labels = ("PD", "proposed", "PD to the same margin", "ASMC-1 (reconstructed)")
    rows = [one for one in study.rows if one.label in labels]
    found = {one.row: one for one in margins(study, rows)}
    least = 1.0 - study.document["spend"]
    assert found["PD"].share == pytest.approx(1.0)
    for label in labels[1:]:
        assert 0.98 * least < found[label].share < 1.2 * least
    assert found["proposed"].delay == pytest.approx(found["PD to the same margin"].delay, rel=1e-3)


@pytest.mark.long
def test_the_row_as_converged_has_the_margins_of_its_gains(study):
    """rho of 0.7 of the ceiling's: 1/(1 + 0.7 g) of PD's delay margin is a rough rule."""
    from adapting.run import margins

    row = next(one for one in study.rows if one.frozen == "converged")
    with pytest.raises(ValueError, match="needs the gains"):
        margins(study, [row])
    zero = margins(study, [row], {name: np.zeros(5) for name in SUBSYSTEMS})[0]
    assert zero.share == pytest.approx(1.0, abs=1e-3)
    made = design.profile(
        study, next(r for r in study.rows if r.label == "proposed"), study.document["strengths"]
    )
    ceilings = {name: np.append(g[:4], 0.0) for name, g in design.largest_gains(made).items()}
    (full,) = margins(study, [row], ceilings)
    assert full.share == pytest.approx(0.52, abs=0.02)


def test_no_integrator_but_the_laws_own(study):
    row = next(one for one in study.rows if one.label == "proposed")
    made = design.profile(study, row, study.document["strengths"])
    gains = made.vehicle.autopilot_parameters()
    assert [gains[f"MC_{axis}RATE_I"] for axis in ("ROLL", "PITCH", "YAW")] == [0.0, 0.0, 0.0]
    assert made.sets["attitude_controller"].feedforward_washout == (0.0, 0.0, 0.0)
    assert made.sets["position_controller"].integral_gain == (0.0, 0.0, 0.0)
    assert made.bridge()["thrust_identification"] == "off"


def test_load_at_the_tip_and_offset_of_the_base():
    plain = Vehicle.load().compile(0.0)
    changes = {"variation.tip_mass": 0.3, "variation.base_offset": [0.01, -0.02]}
    model = Vehicle.load().changed(changes).compile(0.0)
    base, magnet = plain.body("base").id, plain.body("magnet").id
    assert model.body_subtreemass[base] - plain.body_subtreemass[base] == pytest.approx(0.3)
    shift = model.body_ipos[base] - plain.body_ipos[base]
    np.testing.assert_allclose(shift, [0.01, -0.02, 0.0], atol=1e-12)
    # first moment about the pivot: m z + 0.3 kg x 0.0505 m
    moment = plain.body_mass[magnet] * plain.body_ipos[magnet][2] - 0.3 * 0.0505
    assert model.body_mass[magnet] * model.body_ipos[magnet][2] == pytest.approx(moment)
    # moment of inertia about the pivot: that of the magnet + m d^2 of the load
    about = [m.body_inertia[magnet][0] + m.body_mass[magnet] * m.body_ipos[magnet][2] ** 2
             for m in (plain, model)]  # fmt: skip
    assert about[1] - about[0] == pytest.approx(0.3 * 0.0505**2)


def result(row, condition, errors, adaptive, outcome=FLOWN, seed=1):
    shares = {
        name: {"adaptive": adaptive, "feedback": 0.5, "actuators": None} for name in SUBSYSTEMS
    }
    return StudyResult(row, condition, seed, errors, outcome, shares)


def test_cost_by_hand():
    flown = result("a", "nominal", (0.1, 3.0, 2.4), 0.0)  # 2, 1, 2
    cut = result("a", "hard", (0.1, 3.0, 2.4), 0.0, "landed")
    assert cost([flown], [0.05, 3.0, 1.2], 20.0) == pytest.approx(5.0 / 3.0)
    assert cost([flown, cut], [0.05, 3.0, 1.2], 20.0) == pytest.approx((5.0 / 3.0 + 20.0) / 2.0)
    lost = result("a", "hard", (float("nan"),) * 3, 0.0)
    assert cost([lost], [0.05, 3.0, 1.2], 20.0) == 20.0


def test_sentences_count_what_adaptation_carries_and_where_it_wins(study):
    small = replace(study, rows=study.rows[:3], conditions=study.conditions[:2])
    first, second = (one.label for one in small.conditions)
    results = [
        result("proposed", first, (0.02, 2.0, 1.0), 0.6),
        result("proposed", second, (0.02, 2.0, 1.0), 0.2),
        result("PD", first, (0.04, 2.0, 0.5), 0.0),
        result("PD", second, (0.04, 4.0, 0.5), 0.0, "lost"),
    ]
    said = report.sentences(small, results)
    assert "position: adaptation of the proposed law carries 20 to 60 %" in said[0]
    assert "more than half in 1 of 2 conditions" in said[0]
    pd = next(one for one in said if "that of PD:" in one)
    # the second condition has a lost flight, so only the first counts
    assert "position × 0.50 (smaller in 1 of 1)" in pd and "arm × 2.00 (smaller in 0 of 1)" in pd
    assert "PD: 1 of 2 flights not flown to the end." in said


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"rows": {"proposed": None}}, "rows.proposed: a mapping expected, got None"),
        ({"rows": {"a": {"law": "pid"}}}, "rows.a.law: 'pid'"),
        ({"rows": {"a": {"law": "modular", "frozen": "half"}}}, "rows.a.frozen: 'half'"),
        ({"rows": {"a": {"profiles": "s500"}}}, "rows.a.profiles: a list of names expected"),
        ({"conditions": {"a": {"value": "large"}}}, "conditions.a.value: a number expected"),
        ({"conditions": {"a": None}}, "conditions.a: a mapping expected"),
        ({"nominal": {"vehicle": 3}}, "nominal.vehicle: a mapping expected"),
    ],
)
def test_a_wrong_study_is_refused_in_one_line(study, tmp_path, change, text):
    file = tmp_path / "mine.yaml"
    file.write_text(json.dumps(study.document | change))
    with pytest.raises(StudyError, match=text.replace("(", "\\(")) as error:
        load_study(file)
    assert "\n" not in str(error.value)


@pytest.mark.long
def test_the_same_study_gives_the_same_numbers_and_continues(study, tmp_path, monkeypatch):
    """One short flight, twice: equal to the last digit; then without flying."""
    document = study.document | {
        "rows": {"proposed": study.document["rows"]["proposed"]},
        "conditions": {},
        "scenario": {
            "phases": [{"from": 0, "name": "take-off"}, {"from": 1.5, "name": "trajectory"}],
            "moves": [{"coordinate": "z", "from": 0, "until": 1.5, "to": 0.5}],
            "landing": {"at": 2.5, "duration": 2.0},
        },
        "judged": ["trajectory"],
    }
    file = tmp_path / "tiny.yaml"
    file.write_text(json.dumps(document))
    tiny = load_study(file)
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        folder.mkdir()
    first, second = (Runner(tiny, folder, Workplace(1), 1).varied() for folder in folders)
    assert first == second and first[0].outcome == FLOWN
    assert first[0].shares["position"]["adaptive"] > 0.0
    marks = pq.read_table(folders[0] / FILE)["mark"].to_pylist()
    assert len(set(marks)) == len(marks) == 1
    monkeypatch.setattr(experiment, "workers", lambda *_: pytest.fail("flown again"))
    assert Runner(tiny, folders[0], Workplace(1), 1).varied() == first


def test_the_nodes_fly_with_the_autopilot_gains_of_the_study(study, tmp_path):
    """The stand-in reads the vehicle's file, which has other gains."""
    profile = design.profile(study, study.rows[0], study.document["strengths"])
    settings = FlightSettings(
        scenario=load_scenario("hover"), profile=profile, vehicle=profile.vehicle, payload_mass=0.0
    )
    (tmp_path / "logs").mkdir()
    module, arguments = node_arguments.autopilot(settings, ResultFolder(tmp_path), ports_of(0))
    file = arguments[arguments.index("--params") + 1]
    assert module == node_arguments.STAND_IN
    flown = Parameters.of(study.vehicle, file)
    assert {name: flown[name] for name in INTEGRATORS} == INTEGRATORS
    own = FlightSettings(
        scenario=load_scenario("hover"), profile=profile, vehicle=study.vehicle, payload_mass=0.0
    )
    assert "--params" not in node_arguments.autopilot(own, ResultFolder(tmp_path), ports_of(0))[1]


def test_a_candidate_outside_a_parameters_range_costs_as_a_failed_flight(study, tmp_path):
    changed = replace(study, document=deepcopy(study.document))
    beyond = 1e9  # of the law's rate: Q, which follows from it, is beyond its range
    changed.document["ranges"]["modular"]["arm.rate"] = [1.0, 2.0 * beyond]
    changed.document["tuning"]["start"]["modular"]["arm.rate"] = beyond
    strengths = changed.document["strengths"]
    found = search(changed, "modular", strengths, 1, tmp_path, lambda _: None)
    assert found.costs == (changed.document["tuning"]["failed"],)

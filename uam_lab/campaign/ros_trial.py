"""A trial with the ROS engine in lockstep: nodes, topics and MAVLink, as in `uam fly`."""

from __future__ import annotations

from uam_control.mission import load_scenario
from uam_lab.campaign import quiet
from uam_lab.campaign import trial as direct
from uam_lab.campaign.trial import Trial, TrialResult
from uam_lab.flight.settings import ONLOOKERS, FlightSettings


class TrialFailed(RuntimeError):
    """The flight ended with a failure; the text is one line."""


def fly(trial: Trial) -> TrialResult:
    """Fly a trial. Raises TrialFailed."""
    vehicle = trial.profile.vehicle
    scenario = load_scenario(trial.scenario, vehicle)
    settings = FlightSettings(
        scenario=scenario,
        profile=trial.profile,
        vehicle=vehicle,
        payload_mass=trial.payload_mass,
        seed=trial.seed,
        scenario_source=trial.scenario,
        vehicle_changes=trial.vehicle_changes,
        without=ONLOOKERS,
    )
    outcome = quiet.fly(settings)
    if outcome.partial or outcome.series is None:
        raise TrialFailed(
            f"{trial.label}, {trial.payload_mass:g} kg, seed {trial.seed}: "
            f"{outcome.reason or 'nothing was recorded'}"
        )
    outcome.series.info["controller"] = trial.label
    return direct.result(trial, scenario, outcome.series, outcome.abort_reason, outcome.transitions)

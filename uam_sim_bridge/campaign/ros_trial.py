"""A trial flown by the ROS engine: nodes, topics and MAVLink, as `uam fly` does, in lockstep."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from rich.console import Console

from uam_control.mission import load_scenario
from uam_sim_bridge.campaign import trial as direct
from uam_sim_bridge.campaign.trial import Result, Trial
from uam_sim_bridge.flight import ros_engine
from uam_sim_bridge.flight.progress import Progress
from uam_sim_bridge.flight.result_folder import ResultFolder
from uam_sim_bridge.flight.settings import ONLOOKERS, FlightSettings


class NotFlown(RuntimeError):
    """The flight could not go on; the text is one line."""


def fly(trial: Trial) -> Result:
    """Fly it; log and output of the nodes are thrown away. Raises NotFlown."""
    scenario = load_scenario(trial.scenario)
    settings = FlightSettings(
        scenario=scenario,
        profile=trial.profile,
        payload_mass=trial.payload_mass,
        seed=trial.seed,
        scenario_source=trial.scenario,
        vehicle_changes=trial.vehicle_changes,
        without=ONLOOKERS,
    )
    with (
        tempfile.TemporaryDirectory(prefix="uam-trial-") as folder,
        open(os.devnull, "w") as nowhere,
        Progress(Console(file=nowhere)) as progress,
    ):
        outcome = ros_engine.fly(settings, ResultFolder(Path(folder)), progress)
    if outcome.partial or outcome.series is None:
        raise NotFlown(
            f"{trial.label}, {trial.payload_mass:g} kg, seed {trial.seed}: "
            f"{outcome.reason or 'nothing was recorded'}"
        )
    outcome.series.info["controller"] = trial.label
    return direct.result(trial, scenario, outcome.series, outcome.abort_reason, outcome.transitions)

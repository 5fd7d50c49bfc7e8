"""A made-up flight for the tests of the report (the paper's scenario with invented errors), and
real ones of the direct engine."""

from copy import deepcopy
from dataclasses import asdict
from functools import cache

import numpy as np
import pytest
from default_columns import COLUMNS
from whole_flight import SHORT

from uam_control.laws.modular import ModularLaw
from uam_control.mission import load_scenario
from uam_control.mission.motion.trajectory import empty_motion
from uam_control.profiles.profile import load_profile
from uam_control.vehicle import load_description
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import metrics, result_folder
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.timeseries import FlightTable, gain_columns
from uam_sim_bridge.plant import Vehicle

PERIOD = 0.04  # ten times the control period: enough for a picture
TOUCHDOWN = 87.0
LINKS = (0.10, 0.14)  # [m] as in config/vehicle/s500_arm.xml


@cache
def invented(seed, scale):
    """The recording of a made-up flight."""
    scenario = load_scenario("pick_and_place")
    noise = np.random.default_rng(seed)
    times = np.arange(-1.0, TOUCHDOWN + 1.5, PERIOD)
    start = np.zeros(8)
    start[2], start[6:] = 0.285, scenario.arm_start
    trajectory = scenario.trajectory(start)
    recording = FlightTable.of(len(times), load_description())
    motion = empty_motion(2)
    reference = motion[:3]
    phase_of_error = noise.uniform(0, 6, 8)
    amplitude = scale * np.array([0.02, 0.01, 0.015, 0.02, 0.015, 0.01, 0.01, 0.012])
    payload = np.array([-0.789, 0.0, 0.77])
    for time in times:
        flying = 0.0 <= time < TOUCHDOWN
        row = recording.next_row(
            scenario.phase(time) if flying else "waiting" if time < 0.0 else "landed"
        )
        trajectory.write(max(time, 0.0), motion)
        error = amplitude * np.sin(0.7 * time + phase_of_error) * flying
        error += 4.0 * amplitude * np.exp(-abs(time - 35.5)) * flying
        magnet = scenario.magnet_on(time) and flying
        row[:] = 0.0
        row[COLUMNS["time"]] = time
        row[COLUMNS.block("reference.")] = reference.ravel()
        row[COLUMNS.block("truth.")] = reference.ravel()
        truth = row[COLUMNS.block("truth.")]
        truth[:8] += error + 0.05 * amplitude * noise.standard_normal(8)
        truth[2] = max(truth[2], 0.28)
        row[COLUMNS.block("estimate.")] = truth
        row[COLUMNS.block("tau_p.")] = [*error[:2] * 20, (21.6 + 2.0 * magnet) * flying]
        row[COLUMNS.block("tau_q.")] = error[3:6] * 4.0
        row[COLUMNS.block("tau_alpha.")] = 0.3 * np.sin(truth[6:8]) + error[6:8]
        row[COLUMNS.block("setpoint.")] = [*error[3:6], (0.58 + 0.05 * magnet) * flying]
        for subsystem in ("position", "attitude", "arm"):
            names = ModularLaw.gain_names(3)
            gains = np.abs(1.0 + np.sin(0.1 * time + np.arange(len(names))))
            row[COLUMNS.block(f"adaptation.{subsystem}.")] = np.nan
            row[gain_columns(subsystem, names, COLUMNS)] = gains if flying else 0.0
        for i in range(1, 5):
            row[COLUMNS[f"rotor_{i}.command"]] = 0.6 * flying
            row[COLUMNS[f"rotor_{i}.thrust"]] = 5.4 * flying
        face = magnet_face(truth)
        if magnet and time > 35.5:
            payload = face - [0, 0, 0.021]
        elif payload[2] > 0.02 and time > 70.0:
            payload = np.array([payload[0], payload[1], 0.04])
        row[COLUMNS.block("payload.")] = [*payload, 1.0, 0.0, 0.0, 0.0]
        swing = -truth[6] - truth[7] - truth[4]
        row[COLUMNS.block("magnet.")] = [magnet, 25.0 * magnet, swing]
    return recording


def made_up_flight(seed=1, scale=1.0, info=None):
    """A series of the pick-and-place scenario; `scale` multiplies the tracking errors."""
    scenario = load_scenario("pick_and_place")
    facts = {
        "controller": "modular",
        "profile": "s500",
        "scenario": "pick_and_place",
        "engine": "direct",
        "clock": "lockstep",
        "autopilot": "builtin",
        "seed": seed,
        "payload_mass_kg": 0.2,
        "wall_s": 12.0,
        "abort_reason": "",
        "drop_point": list(scenario.drop_point),
        "snapshots": [list(s) for s in scenario.snapshots],
        "command": f"uam fly --engine direct --seed {seed}",
    }
    return deepcopy(invented(seed, scale)).series(facts | (info or {}))


def magnet_face(chi):
    """World position (3,) of the magnet's face for level attitude, chi (8,) or longer."""
    first, both = chi[6], chi[6] + chi[7]
    forward = LINKS[0] * np.sin(first) + LINKS[1] * np.sin(both)
    down = 0.073 + LINKS[0] * np.cos(first) + LINKS[1] * np.cos(both) + 0.030
    return np.array([chi[0] + forward, chi[1], chi[2] - down])


def write_folder(directory, series):
    """What a flight leaves in its result folder before the report is made."""
    folder = ResultFolder.create("pick_and_place", "modular", out=directory)
    series.write(folder.timeseries)
    result_folder.write_json(folder.info, series.info)
    result_folder.write_json(folder.metrics, metrics.compute(series, series.info))
    result_folder.write_json(folder.versions, result_folder.versions())
    profile = load_profile("s500")
    folder.write_parameters({node: asdict(values) for node, values in profile.sets.items()})
    return folder.path


@pytest.fixture
def flight_folder(tmp_path, flight):
    """A result folder with the made-up flight, no report yet."""
    return write_folder(tmp_path / "flight", flight)


@pytest.fixture(scope="session")
def flight():
    """The made-up flight."""
    return made_up_flight()


@pytest.fixture
def make_flight():
    """`made_up_flight` itself."""
    return made_up_flight


def flown(scenario, seed=1, mass=0.2):
    """A flight of the direct engine with the flying profile."""
    flight = DirectFlight(scenario, load_profile("s500"), Vehicle.load(), mass, seed)
    info = {"controller": "modular", "payload_mass_kg": mass, "seed": seed}
    return flight.run().series(info)


@pytest.fixture(scope="session")
def direct_flight():
    """The pick-and-place mission in the direct engine."""
    return flown(load_scenario("pick_and_place"))


@pytest.fixture(scope="session")
def short_direct_flight(tmp_path_factory):
    """Up and down, three seconds."""
    file = tmp_path_factory.mktemp("scenario") / "short.yaml"
    file.write_text(SHORT)
    return flown(load_scenario(str(file)))

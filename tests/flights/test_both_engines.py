"""Both engines fly the same with faults: the single precision of MAVLink is all that differs.

Sensors of the autopilot, poses, setpoints and motor commands travel as float32, with a relative
error of 2^-24 each. The closed loops are stable, so such errors do not grow; tau_p, tau_q and the
accelerations multiply them by gains and filters. TOLERANCE allows 2000 of them, relative to the
largest value of a column in the flight: 1.2e-4. A command that acts one tick later gives more than
1e-3.

Contact with the ground multiplies errors, until a joint angle is read as the next encoder count.
From then on the pose and the phase alone are compared.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from default_columns import COLUMNS

from uam_control.coordinates import BASE_COORDINATES
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import timeseries
from uam_lab.records.results.outcome import transitions
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets

TOLERANCE = 2000 * 2.0**-24
POSE = tuple(f"truth.{name}" for name in BASE_COORDINATES)
# Published less often over ROS than the direct engine records them; compared at these stamps.
SLOW = ("thrust.factor", *(f"adaptation.{subsystem}." for subsystem in SUBSYSTEMS))
FLIGHTS = {
    "flown through": (
        "wind_gust@take-off+0+1.5:speed=2",
        "mocap_dropout@take-off+0.5+0.2",
        "encoder_stuck@take-off+0.8+0.1",
        "motor_loss@hover+0+0.3:remaining=0.95",
        "imu_dropout@hover+0.1+0.04",
        "mavlink_cut@hover+0.3+0.2",
    ),
    "tracker frozen": ("mocap_freeze@take-off+0.7",),
    "tracker moved": ("mocap_jump@take-off+0.9",),
    "link lost": ("mavlink_cut@take-off+1.2",),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FLIGHTS)
def test_only_single_precision_differs(name, fly, short_scenario):
    faults = FLIGHTS[name]
    options = [word for fault in faults for word in ("--fault", fault)]
    ros = fly("--scenario", str(short_scenario), "--seed", "3", *options)
    assert ros.wait() in (0, 1), ros.said + ros.complained
    scenario = load_scenario(str(short_scenario))
    schedule = read_schedule(faults, scenario, 3)
    direct = DirectFlight(scenario, load_profile("s500"), Vehicle.load(), 0.0, 3, schedule)
    direct.run()

    assert_same_transitions(ros, direct)
    assert_same_rows(timeseries.read(ros.out / "timeseries.parquet"), direct.recording.series())


@pytest.mark.slow
@pytest.mark.parametrize("layout", [[], ["--fused"]])
def test_poses_of_an_odometry_that_drifts_and_jumps(layout, fly, short_scenario):
    """nav_msgs/Odometry in place of the motion capture, in both layouts."""
    chosen = ["odometry"], ["odometry_drift:jumps=0.3"]
    options = ["--plant-preset", *chosen[0], "--effect", *chosen[1], *layout]
    ros = fly("--scenario", str(short_scenario), "--seed", "3", *options)
    assert ros.wait() in (0, 1), ros.said + ros.complained  # 1: a jump moved the landing, too
    vehicle = Vehicle.load().changed(presets.added({}, presets.read(*chosen)))
    direct = DirectFlight(load_scenario(str(short_scenario)), load_profile("s500"), vehicle, 0.0, 3)
    direct.run()
    assert_same_transitions(ros, direct)
    assert_same_rows(timeseries.read(ros.out / "timeseries.parquet"), direct.recording.series())


def assert_same_transitions(ros, direct):
    found = json.loads((ros.out / "metrics.json").read_text())["transitions"]
    assert found == [
        {**one, "time_s": pytest.approx(one["time_s"], abs=1e-6)}
        for one in transitions(direct.mission.changes)
    ]


def assert_same_rows(ros, direct):
    stamps = [np.round(series.time * 1e6).astype(int) for series in (ros, direct)]
    rows = min(map(len, stamps))  # the plant over ROS learns of the end a tick or two later
    assert max(map(len, stamps)) - rows <= 2
    assert np.array_equal(stamps[0][:rows], stamps[1][:rows])
    assert np.array_equal(ros.phases[:rows], direct.phases[:rows])
    a, b, landed = ros.values[:rows], direct.values[:rows], touchdown(direct)
    assert np.array_equal(np.isnan(a).all(axis=0), np.isnan(b).all(axis=0))
    # blind ticks have no state; over ROS they may have a reference that no tick used
    states = a[:, COLUMNS.block("estimate.")]
    blind = ~np.any(np.diff(states, axis=0, prepend=np.nan), axis=1)
    differing = {}
    for column, name in enumerate(COLUMNS.names):
        compared = np.arange(rows) < (rows if name in POSE else landed)
        if name.startswith(SLOW):
            compared &= ~np.isnan(a[:, column]) & (np.diff(a[:, column], prepend=np.nan) != 0.0)
            compared[0] = False
        if name.startswith(("reference.", "error.")):
            compared &= ~blind
        x, y = a[compared, column], b[compared, column]
        unknown = np.isnan(x)  # as the rates of an attitude setpoint are
        assert np.array_equal(unknown, np.isnan(y)), name
        if not unknown.all():
            x, y = x[~unknown], y[~unknown]
            error = np.abs(x - y).max() / max(1.0, np.abs(y).max())
            if not error <= TOLERANCE:
                differing[name] = float(error)
    assert differing == {}


def touchdown(series):
    """The row in which the vehicle comes back to within 3 cm of the ground."""
    height = series["truth.z"] - series["truth.z"][0]
    airborne = np.argmax(height > 0.1)
    assert airborne > 0
    return airborne + np.argmax(height[airborne:] < 0.03)

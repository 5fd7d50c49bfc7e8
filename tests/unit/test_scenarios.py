"""Scenarios with a trajectory: transit, ramps, landing point, the form of the file."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.mission import ScenarioError, ScenarioOptions, load_scenario
from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios.scenario import standing
from uam_control.settings import configuration

CIRCLE = "{kind: circle, radius: 1.0, speed: 2.0, laps: 4, height: 1.2, ramp: 3.0}"
MOVES = """
arm_start: {alpha_1_deg: 0, alpha_2_deg: 90}
landing: {at: 40, duration: 5}
phases: [{from: 0, name: take-off}, {from: 40, name: land}]
moves:
  - {coordinate: z, from: 0, until: 3, to: 1.0}
  - {coordinate: x, from: 3, until: 6, to: 0.5}
  - {coordinate: y, from: 0, until: 2, to: 0.0}
  - {coordinate: alpha_1, from: 12, until: 16, to_deg: 40}
"""


def made(folder, text, **options):
    file = folder / "made.yaml"
    file.write_text(text)
    return load_scenario(str(file), options=ScenarioOptions(**options))


def rows_of(scenario, start=None, step=0.01):
    """Times and reference (m, 5, 8) of the whole flight."""
    begun = scenario if start is None else scenario.begun_at(start)
    trajectory = begun.trajectory(standing(begun.arm_start) if start is None else start)
    times = np.arange(0.0, begun.landing.at + begun.landing.duration, step)
    if isinstance(trajectory, Polynomials):
        return times, trajectory.rows(times, 3).swapaxes(0, 1)
    rows = np.empty((len(times), 5, 8))
    for time, reference in zip(times, rows, strict=True):
        trajectory.write(time, reference)
    return times, rows[:, :3]


def names(scenario):
    return [name for _, name in scenario.phases]


def test_a_curve_has_ways_there_and_back(tmp_path):
    scenario = made(tmp_path, f"trajectory: {CIRCLE}")
    assert names(scenario) == [
        *("take-off", "transit", "run-up", "trajectory", "run-out", "return", "land"),
    ]
    begins = {name: time for time, name in scenario.phases}
    assert begins["trajectory"] - begins["run-up"] == pytest.approx(3.0)
    # four laps of pi seconds; each ramp covers half of the way at speed
    assert begins["return"] - begins["run-up"] == pytest.approx(4 * np.pi + 3.0)
    times, rows = rows_of(scenario)
    speed = np.linalg.norm(rows[:, 1, :3], axis=1)
    steady = (times > begins["trajectory"] + 0.01) & (times < begins["run-out"] - 0.01)
    np.testing.assert_allclose(speed[steady], 2.0, atol=1e-6)
    np.testing.assert_allclose(rows[-1, 0, :2], 0.0, atol=1e-6)
    assert scenario.landing_point is None


def test_it_may_land_where_it_ends(tmp_path):
    scenario = made(tmp_path, f"trajectory: {CIRCLE}\nend: land")
    assert names(scenario)[-2:] == ["run-out", "land"]
    assert scenario.landing_point == pytest.approx((1.0, 0.0))
    _, rows = rows_of(scenario)
    np.testing.assert_allclose(rows[-1, 0, :2], [1.0, 0.0], atol=1e-9)
    assert made(tmp_path, f"trajectory: {CIRCLE}\nend: land", end="return").landing_point is None
    assert made(tmp_path, f"trajectory: {CIRCLE}", end="land").landing_point is not None


@settings(max_examples=25, deadline=None)
@given(
    x=st.floats(-4, 4), y=st.floats(-4, 4), yaw=st.floats(-3.1, 3.1),
    speed=st.floats(0.3, 2.0), acceleration=st.floats(0.3, 2.0),
)  # fmt: skip
def test_transit_is_bounded_and_smooth_from_everywhere(
    tmp_path_factory, x, y, yaw, speed, acceleration
):
    scenario = made(
        tmp_path_factory.mktemp("made"),
        f"trajectory: {CIRCLE}",
        transit_speed=speed,
        transit_acceleration=acceleration,
    )
    start = standing(scenario.arm_start)
    start[[0, 1, 5]] = x, y, yaw
    begun = scenario.begun_at(start)
    times, rows = rows_of(scenario, start)
    begins = dict(reversed([(name, time) for time, name in begun.phases]))
    own = np.array([begun.phase(t) in ("take-off", "transit", "return", "land") for t in times])
    assert np.linalg.norm(rows[own, 1, :3], axis=1).max() <= speed + 1e-6
    assert np.linalg.norm(rows[own, 2, :3], axis=1).max() <= acceleration * 1.001
    assert np.abs(rows[own, 1, 5]).max() <= 0.8 + 1e-6
    for row in (0, 1):
        change = np.diff(rows[:, row], axis=0) / 0.01 - (rows[1:, row + 1] + rows[:-1, row + 1]) / 2
        assert np.abs(change).max() < 0.02
    np.testing.assert_allclose(rows[0, 0], start, atol=1e-9)
    np.testing.assert_allclose(rows[-1, 0, :2], [x, y], atol=1e-5)
    assert begins["take-off"] == 0.0 and times[-1] < begun.landing.at + begun.landing.duration


def test_samples_at_speed_are_entered_and_left_smoothly(tmp_path):
    times = np.arange(0.0, 6.0, 0.05)
    file = tmp_path / "fast.csv"
    lines = [f"{t},{np.cos(2 * t)},{np.sin(2 * t)},1.5" for t in times]
    file.write_text("\n".join(["t,px,py,pz", *lines]) + "\n")
    scenario = load_scenario(str(file))
    assert names(scenario)[2:5] == ["run-up", "trajectory", "run-out"]
    clock, rows = rows_of(scenario)
    change = np.diff(rows[:, 1], axis=0) / 0.01 - (rows[1:, 2] + rows[:-1, 2]) / 2
    assert np.abs(change).max() < 0.02
    assert np.abs(np.diff(rows[:, 2], axis=0)).max() < 0.15  # jerk below 15 m/s^3
    begins = {name: time for time, name in scenario.phases}
    up = (clock >= begins["run-up"]) & (clock < begins["trajectory"])
    assert np.linalg.norm(rows[up, 2, :3], axis=1).max() <= 1.25 * 4.0 * 1.01
    assert rows[:, 0, 2].max() < 1.51


def test_a_trajectory_at_rest_above_the_take_off_needs_no_transit():
    assert names(load_scenario("circle")) == ["take-off", "trajectory", "land"]


def test_slower_takes_longer_by_the_factor(tmp_path):
    fast, slow = (made(tmp_path, f"trajectory: {CIRCLE}", slowdown=s) for s in (1.0, 2.0))
    for one, factor in ((fast, 1.0), (slow, 2.0)):
        begins = {name: time for time, name in one.phases}
        assert begins["return"] - begins["run-up"] == pytest.approx(factor * (4 * np.pi + 3.0))
        assert begins["transit"] == 3.0
    paper = load_scenario("pick_and_place", options=ScenarioOptions(slowdown=1.5))
    assert paper.magnet[0] == (52.5, True) and paper.landing.at == 123.0
    assert rows_of(paper)[1][4500, 0, 0] == pytest.approx(-1.0)  # at 45 s


def test_a_trajectory_amid_moves_adds_to_them(tmp_path):
    entry = "{kind: lemniscate, size: [2.0, 1.0], period: 8.0, laps: 2, ramp: 3.0, at: 10}"
    scenario = made(tmp_path, f"{MOVES}trajectory: {entry}")
    assert names(scenario) == ["take-off", "run-up", "trajectory", "run-out", "take-off", "land"]
    times, rows = rows_of(scenario)
    np.testing.assert_allclose(np.ptp(rows[:, 0, 0]), 2.0, atol=1e-3)  # -0.5 to 1.5
    inner = (times > 14.0) & (times < 28.0)
    np.testing.assert_allclose(rows[inner, 0, 0].max(), 1.5, atol=1e-3)
    assert np.degrees(rows[times > 17.0][0, 0, 6]) == pytest.approx(40.0)
    after = rows[times > 10 + 19.01][0]
    np.testing.assert_allclose(after[0, :3], [0.5, 0.0, 1.0], atol=1e-6)


def test_joints_sweep_while_a_curve_is_flown(tmp_path):
    sweep = "sweep: [{joint: alpha_1, amplitude_deg: 30, cycles: 2}]"
    entry = CIRCLE[:-1] + f", arm_deg: [10, 60], {sweep}}}"
    times, rows = rows_of(made(tmp_path, f"trajectory: {entry}"))
    assert np.degrees(rows[:, 0, 6].max()) == pytest.approx(40.0, abs=0.01)
    assert np.degrees(rows[-1, 0, 6:]) == pytest.approx([0.0, 90.0], abs=1e-6)


@pytest.mark.parametrize("name", configuration.names("scenarios"))
def test_every_scenario_of_the_library_is_smooth(name):
    from uam_control.vehicle import load_description

    flown_by = {"arm3_motions": "s500_arm3", "circle_arm3": "s500_arm3", "pillars": "t650_gripper"}
    vehicle = load_description(flown_by.get(name, "s500_arm"))
    scenario = load_scenario(name, vehicle)
    start = standing(scenario.arm_start)
    trajectory, end = scenario.trajectory(start), scenario.landing.at + scenario.landing.duration
    times = np.arange(0.0, end, 0.01)
    rows = np.empty((len(times), 5, len(start)))
    for time, reference in zip(times, rows, strict=True):
        trajectory.write(time, reference)
    for row in (0, 1):
        change = np.diff(rows[:, row], axis=0) / 0.01 - (rows[1:, row + 1] + rows[:-1, row + 1]) / 2
        assert np.abs(change).max() < 0.05 * (1.0 + np.abs(rows[:, row + 1]).max())
    assert scenario.description


def test_a_lap_that_is_too_short_for_the_usual_ramp_has_one_of_half_its_length(tmp_path):
    """1 m at 5 m/s: a lap of 1.26 s; 2 m/s^2 would need a ramp of some 5 s."""
    file = tmp_path / "fast.yaml"
    file.write_text("trajectory: {kind: circle, radius: 1, height: 1, speed: 5}\n")
    lengths = [leg.path.length for leg in load_scenario(str(file)).route.legs]
    lap = 2.0 * np.pi / 5.0
    np.testing.assert_allclose(lengths, [lap / 2.0, lap / 2.0, lap / 2.0], rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "trajectory: {kind: square}",
            "kind: 'square' is not one of circle, ellipse, lemniscate, waypoints, end_effector",
        ),
        ("trajectory: {kind: circle, radius: 1, size: [1, 1]}", "size: unknown"),
        ("trajectory: {kind: circle, radius: 1, height: 1}", "period: exactly one of period"),
        ("trajectory: {kind: circle, radius: 0, height: 1}", "radius: 0 is not above 0"),
        ("trajectory: {kind: circle, radius: 1, height: 1, period: 4, speed: 2}", "exactly one"),
        (
            "trajectory: {kind: circle, radius: 1, height: 1, period: 2, laps: 1, ramp: 3}",
            "laps: 1 of 2 s are shorter than the ramps of 3 s",
        ),
        (
            "trajectory: {kind: circle, radius: 1, height: 1, duration: 9, ramp: 3}",
            "ramp: only with period or speed",
        ),
        (
            "trajectory: {kind: ellipse, size: [1, 0], height: 1, period: 9}",
            "size: .* both must be above 0",
        ),
        (
            "trajectory: {kind: circle, radius: 1, height: 1, period: 9, yaw: north}",
            "yaw: 'north', allowed: tangent",
        ),
        (
            "trajectory: {kind: circle, radius: 1, height: 1, period: 9, arm_deg: [0, 200]}",
            "arm_deg: alpha_2 from 200 to 200, allowed -120 to 120",
        ),
        (
            "trajectory: {kind: circle, radius: 1, height: 1, period: 9, "
            "sweep: [{joint: wrist, amplitude_deg: 9, cycles: 1}]}",
            r"sweep\[0\].joint: 'wrist' is not one of alpha_1, alpha_2",
        ),
        ("trajectory: {kind: waypoints, points: [[0, 0, 1]], speed: 1}", "two or more"),
        (
            "trajectory: {kind: waypoints, points: [[0, 0, 1], [0, x, 1]], speed: 1}",
            r"points\[1\]: a number expected, got 'x'",
        ),
        (
            "trajectory: {kind: waypoints, points: [[0, 0, 1], [0, 0, 1]], speed: 1}",
            "points 0 and 1 are the same",
        ),
        (
            "trajectory: {kind: waypoints, points: [[0, 0, 1], [1, 0, 1]]}",
            "speed: one of speed, duration; or times",
        ),
        (
            "trajectory: {kind: waypoints, points: [[0, 0, 1], [1, 0, 1]], speed: 1, laps: 2}",
            "laps: the last point must equal the first",
        ),
        (
            "trajectory: {kind: waypoints, points: [[0, 0, 1], [1, 0, 1]], times: [0, 0]}",
            "times: begin at 0 and increase",
        ),
        (f"trajectory: {CIRCLE}\nend: hover", "end: 'hover' is not one of return, land"),
        (f"trajectory: {CIRCLE}\nmagnet: []", "magnet: not together with a trajectory alone"),
        (f"trajectory: {CIRCLE}\nspeed: 3", "speed: unknown"),
        (f"{MOVES}trajectory: {CIRCLE}", "trajectory.at is missing"),
        (
            f"{MOVES}trajectory: {CIRCLE[:-1]}, at: 10}}",
            "height: not with at: the trajectory begins where the moves are",
        ),
        (
            f"{MOVES}trajectory: {{kind: circle, radius: 1, period: 9, laps: 1.5, at: 10}}",
            "at: the trajectory ends 2 m from its begin, 0 m allowed",
        ),
        (
            f"{MOVES}trajectory: {{kind: circle, radius: 1, period: 9, laps: 1, at: 5}}",
            r"moves\[1\]: x moves during the trajectory, from 5 to 17 s",
        ),
        (
            f"{MOVES}trajectory: {{kind: circle, radius: 1, period: 9, laps: 3, at: 20}}",
            "landing: at 40 s",
        ),
    ],
)
def test_a_bad_trajectory_is_refused_in_one_line(tmp_path, text, reason):
    with pytest.raises(ScenarioError, match=reason) as caught:
        made(tmp_path, text)
    assert "\n" not in str(caught.value)

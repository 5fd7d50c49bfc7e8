"""The paper's scenario, and what a scenario file must not contain."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.mission import ScenarioError, load_scenario
from uam_control.mission.motion.trajectory import empty_motion

START = np.array([0.0, 0.0, 0.28, 0.0, 0.0, 0.0, 0.0, np.pi / 2])


def value(trajectory, time):
    motion = empty_motion(2)
    trajectory.write(time, motion)
    return motion


def assert_smooth(trajectory, end, speed, acceleration, step=1e-3):
    """Rates are derivatives of values, and all values are bounded."""
    for time in np.arange(step, end, 0.0317):
        before, now, after = (value(trajectory, time + d) for d in (-step, 0.0, step))
        np.testing.assert_allclose((after[0] - before[0]) / (2 * step), now[1], atol=1e-4)
        np.testing.assert_allclose((after[1] - before[1]) / (2 * step), now[2], atol=2e-2)
        assert np.all(np.abs(now[1]) <= speed) and np.all(np.abs(now[2]) <= acceleration)


def test_the_papers_scenario():
    scenario = load_scenario("pick_and_place")
    trajectory = scenario.trajectory(START)
    assert_smooth(trajectory, 90.0, speed=1.0, acceleration=2.0)
    degrees = np.degrees
    assert value(trajectory, 2.0)[0, 0] == 0.0
    at_payload = value(trajectory, 30.0)[0]
    assert at_payload[:2] == pytest.approx([-1.0, 0.0])
    assert degrees(at_payload[6:]) == pytest.approx([45.0, 45.0])
    at_drop = value(trajectory, 65.0)[0]
    assert at_drop[:3] == pytest.approx([1.0, 0.0, 1.0])
    assert degrees(at_drop[6:]) == pytest.approx([-45.0, -45.0])
    assert value(trajectory, 82.0)[0, :3] == pytest.approx([0.0, 0.0, 1.0])
    assert [scenario.magnet_on(t) for t in (34.9, 35.0, 69.9, 70.0)] == [False, True, True, False]
    assert [scenario.phase(t) for t in (0, 2, 34, 36, 66, 71, 83)] == [
        "take-off",
        "approach",
        "pick",
        "carry",
        "drop",
        "return",
        "land",
    ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("moves: [", "line 1.* not valid YAML"),
        ("- a list", "a mapping expected"),
        ("arm_start: {alpha_1_deg: 0, alpha_2_deg: 0}", "landing is missing"),
        (
            "arm_start: {alpha_1_deg: 0, alpha_2_deg: 0, alpha_3_deg: 0}",
            "arm_start.alpha_3_deg: no joint; s500_arm has: alpha_1_deg, alpha_2_deg",
        ),
        (
            "arm_start: {alpha_1_deg: 0, alpha_2_deg: 130}",
            "arm_start.alpha_2_deg: 130; s500_arm allows -120 to 120",
        ),
        (
            "arm_start: {alpha_1_deg: 0, alpha_2_deg: x}\nlanding: {at: 5, duration: 3}",
            "arm_start.alpha_2_deg: a number expected, got 'x'",
        ),
        (
            "arm_start: {alpha_1_deg: 0, alpha_2_deg: 0}\nlanding: {at: 5, duration: 3}\n"
            "moves: [{coordinate: roll, from: 0, until: 1, to: 1}]",
            "coordinate: 'roll' is not one of x",
        ),
        (
            "arm_start: {alpha_1_deg: 0, alpha_2_deg: 0}\nlanding: {at: 5, duration: 3}\n"
            "moves: [{coordinate: x, from: 0, until: 2, to: 1},"
            " {coordinate: x, from: 1, until: 3, to: 0}]",
            "two moves of x overlap at 1",
        ),
        (
            "landing: {at: 5, duration: 3}\npayload: {mass: 0.2, drop_point: [x, 0]}",
            "payload.drop_point: a number expected, got 'x'",
        ),
        (
            "landing: {at: 5, duration: 3}\nmagnet: [{at: 1, energised: 1}]",
            r"magnet\[0\].energised: true or false expected, got 1",
        ),
        ("landing: {at: 5, duration: 0}", "landing.duration: 0 is not above 0"),
        ("landing: {at: 5, duration: -1}", "landing.duration: -1 is not above 0"),
        ("landing: {at: -5, duration: 1}", "landing.at: -5 is below 0"),
        (
            "landing: {at: 5, duration: 3}\nmoves: [{coordinate: z, from: 0, until: 5.5, to: 1}]",
            r"moves\[0\].until: 5.5 s, but the landing begins at 5 s",
        ),
        (
            "landing: {at: 5, duration: 3}\n"
            "moves: [{coordinate: alpha_1, from: 0, until: 8.5, to_deg: 1}]",
            r"moves\[0\].until: 8.5 s, but the landing ends at 8 s",
        ),
        (
            "landing: {at: 5, duration: 3}\nmoves: [{coordinate: z, from: -1, until: 2, to: 1}]",
            r"moves\[0\].from: -1 is below 0",
        ),
        (
            "landing: {at: 5, duration: 3}\n"
            "magnet: [{at: 4, energised: false}, {at: 2, energised: true}]",
            r"magnet\[1\].at: 2 s is not after the entry before, 4 s",
        ),
        (
            "landing: {at: 5, duration: 3}\nphases: [{from: 1, name: late}]",
            "phases: the first begins at 1 s, it must begin at 0",
        ),
        ("landing: {at: 5, duration: 3}\npayload: {mass: -0.2}", "payload.mass: -0.2 is below 0"),
    ],
)
def test_bad_scenario_is_refused(tmp_path, text, reason):
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=reason):
        load_scenario(str(file))


def test_unknown_scenario_lists_the_known_ones():
    with pytest.raises(ScenarioError, match="hover.*pick_and_place"):
        load_scenario("nonsense")


TIMED = """description: up
phases: [{from: 0, name: up}]
moves: [{coordinate: z, from: 0, until: 4, to: 1}]
landing: {at: 12, duration: 5}
payload: {mass: 0.1}
"""


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("duration: 5", "duration: 5, drop: 1", "landing.drop: unknown; allowed: at, duration"),
        (
            "to: 1",
            "to: 1, form: 2",
            r"moves\[0\].form: unknown, did you mean from. allowed: ",
        ),
        ("mass: 0.1", "mass: 0.1, droppoint: [0, 1]", "payload.droppoint: unknown"),
        ("payload: {mass: 0.1}", "payload: 0", "payload: a mapping expected, got 0"),
        (", name: up", "", r"phases\[0\].name is missing"),
        ("name: up", "name: [a, b]", r"phases\[0\].name: a name expected"),
        ("description: up", "description: [1]", "description: a name expected"),
        ("duration: 5", "duration: 1e-300", "landing.duration: 1e-300 s is below 0.001 s"),
        ("until: 4", "until: 1e-9", r"moves\[0\].until: 1e-09 s is not 0.001 s after from, 0 s"),
        ("payload:", '"pay\\nload\\e":', "pay␊load␛: unknown, did you mean payload"),
    ],
)
def test_an_entry_that_nothing_reads_is_refused(tmp_path, old, new, reason):
    file = tmp_path / "made.yml"
    file.write_text(TIMED)
    assert load_scenario(str(file)).landing.at == 12.0
    file.write_text(TIMED.replace(old, new))
    with pytest.raises(ScenarioError, match=f"made.yml: {reason}"):
        load_scenario(str(file))


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("folder.csv", "folder.csv is no file"),
        ("gone.csv", "gone.csv does not exist"),
        ("path.txt", "path.txt: a name that ends in .yaml, .yml, .csv expected"),
    ],
)
def test_a_file_that_is_no_scenario_is_refused_by_its_name(tmp_path, name, reason):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "path.txt").write_text("t,px,py,pz\n0,0,0,1\n1,0,0,1\n")
    with pytest.raises(ScenarioError, match=reason):
        load_scenario(str(tmp_path / name))

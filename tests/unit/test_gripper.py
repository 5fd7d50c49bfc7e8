"""The two-finger gripper: description, plant, evidence, approaches from any side."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.arm.chain import Chain
from uam_control.arm.hand import hands
from uam_control.grasp import Grasp, GraspExecutive, GraspParameters, Sight, grasp_windows
from uam_control.grasp.evidence import GRIPPERS, Evidence, fused
from uam_control.grasp.windows import Approach
from uam_control.mission import Mission, MissionParameters, ScenarioError, load_scenario
from uam_control.mission.motion.trajectory import Move
from uam_control.mission.scenarios.scenario import standing
from uam_control.profiles.profile import default_profile
from uam_control.settings import configuration
from uam_control.vehicle import (
    OpenEnd,
    VehicleError,
    chain_of,
    derived_parameters,
    load_description,
)
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

S500 = load_description("s500_gripper")
P = GraspParameters(gripper="two_finger", gripper_opening=(0.02, 0.075), gripper_force=10.0)
FINGERS = GRIPPERS["two_finger"]
PLACE = np.array([1.0, 2.0, 0.8])


def test_the_vehicle_derives_from_the_s500():
    """2.2 kg - magnet 0.07 kg + gripper 0.15 kg + two fingers of 11 g = 2.302 kg."""
    magnet = load_description("s500_arm")
    assert S500.mass == pytest.approx(magnet.mass - 0.07 + 0.15 + 2 * 0.011)
    assert S500.rotors == magnet.rotors and S500.profiles == magnet.profiles
    assert (S500.gripper.kind, magnet.gripper.kind) == ("two_finger", "magnet")
    assert load_description("t650").gripper.kind == "none"


def test_jaws_that_move_weigh_as_much_as_the_rigid_ones():
    """Fingers of 22 g in place of jaws of 22 g: the last link of t650 stays 0.2495 kg."""
    rigid, moving = (load_description(name) for name in ("t650", "t650_gripper"))
    assert moving.mass == rigid.mass == 3.746174 and moving.gripper.opening == (0.019, 0.038)
    for of in map(chain_of, (rigid, moving)):
        assert of.masses[-1] == pytest.approx(0.2495176)
        assert of.centres[-1] == pytest.approx([-0.005467, 0.001698, -0.039619], abs=1e-8)


def test_the_tip_is_where_the_parts_say():
    """link_2 begins 0.173 m below the base; the gripper 0.1 m below it, its tip 0.108 m further."""
    chain: Chain = chain_of(S500)
    assert chain.offsets.sum(axis=0) + chain.hand_place == pytest.approx([0.0, 0.0, -0.381])


def test_the_mission_knows_the_grippers_numbers():
    mission = derived_parameters(S500)["mission"]
    assert mission["gripper"] == "two_finger" and mission["gripper_opening"] == [0.02, 0.075]
    assert mission["gripper_force"] == 10.0 and mission["press_depth"] == 0.012


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("derives: s500_arm\n", ""),
        ("derives: own\n", "derives: own.yaml derives from own.yaml"),
        ("derives: s500_arm\ngripper: {type: two_finger, body: link_2, position: [0, 0, 0]}\n",
         "gripper: the vehicle has a magnet, too"),
        ("derives: s500_arm\ngripper: none\n", "gripper: none, but the vehicle has a magnet, too"),
        ("derives: s500_gripper\ngripper: {opening: [0.05, 0.02]}\n", "[0.05, 0.02]: closed"),
        ("derives: s500_gripper\ngripper: {force: 0}\n", "gripper.force: 0 is not above 0"),
        ("derives: s500_gripper\ngripper: {type: pincers}\n",
         "unknown gripper 'pincers'; there are: two_finger, or"),
        ("derives: s500arm\n", "own.yaml: unknown vehicle 's500arm'"),
        ("derives: s500_arm\nprofiles: {modular: s501}\n", "own.yaml: unknown profile 's501'"),
        ("derives: s500_arm\nautopilot: s501\n", "own.yaml: unknown autopilot 's501'"),
        ("derives: s500_arm\nprofiles: {modulr: s500}\n", "own.yaml: profiles.modulr: unknown"),
        ("derives: s500_gripper\nmas: 2.0\n", "mas"),
    ],
)  # fmt: skip
def test_a_derived_file_is_checked_as_a_whole(tmp_path, text, reason):
    file = tmp_path / "own.yaml"
    file.write_text(text.replace("derives: own", f"derives: {file}"))
    if not reason:
        assert load_description(file).rotors == S500.rotors
        return
    with pytest.raises(ValueError) as refused:
        default_profile("modular", load_description(file))
    assert reason in str(refused.value) and "\n" not in str(refused.value)


def test_the_design_of_a_derived_vehicle_acts(tmp_path):
    file, design = tmp_path / "own.yaml", tmp_path / "own_profile.yaml"
    file.write_text("derives: s500_gripper\n")
    assert load_description(file).profile("modular") == "s500"
    design.write_text("")
    assert load_description(file).profile("modular") == str(design)


def test_files_beside_a_vehicle_count_for_what_derives_from_it(tmp_path):
    """Base and heir are in two folders; gripper and design are beside the base."""
    base, heir = tmp_path / "base.yaml", tmp_path / "heirs" / "heir.yaml"
    grippers = configuration.root() / "grippers"
    for name in ("two_finger.yaml", "two_finger.xml"):
        (tmp_path / name).write_text((grippers / name).read_text())
    gains = (configuration.root() / "autopilot" / "s500.yaml").read_text()
    (tmp_path / "base_autopilot.yaml").write_text(gains)
    base.write_text(
        "derives: s500_gripper\nautopilot: null\ngripper: {type: two_finger.yaml, force: 5}\n"
    )
    heir.parent.mkdir()
    heir.write_text("derives: ../base.yaml\nmass: 2.302\n")
    found = load_description(heir)
    assert found.models[1].samefile(tmp_path / "two_finger.xml") and found.gripper.force == 5.0
    assert found.autopilot_gains == S500.autopilot_gains


def test_a_body_that_is_not_there_is_named(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text("derives: s500_gripper\ngripper: {body: link_9}\n")
    with pytest.raises(VehicleError, match="no body 'link_9' for the gripper of own.yaml"):
        chain_of(load_description(file))


def test_a_vehicle_without_a_gripper_refuses_a_scenario_that_grips(tmp_path):
    file = tmp_path / "bare.yaml"
    file.write_text("derives: s500_gripper\nend_effector: null\nmass: 2.13\ngripper: none\n")
    bare = load_description(file)
    assert bare.gripper.kind == "none"
    with pytest.raises(ScenarioError, match="magnet: bare has no gripper"):
        load_scenario("two_finger", bare)


def test_a_vehicle_without_a_magnet_whose_model_has_one_says_what_to_do(tmp_path):
    file = tmp_path / "bare.yaml"
    file.write_text("derives: s500_arm\nmagnet: null\n")
    with pytest.raises(VehicleError, match="'magnet_swing' is a magnet's.*leave it out"):
        MujocoPlant(Vehicle.of(load_description(file)), 0.0, 1)


def sight(opening: float, squeeze: float, tracked: bool = True, **more) -> Sight:
    payload = PLACE if tracked else np.full(3, math.nan)
    return Sight(1.0, 20.0, PLACE, payload=payload, opening=opening, squeeze=squeeze, **more)


@pytest.mark.parametrize(
    ("opening", "squeeze", "held"),
    [
        (0.040, 10.0, True),
        (0.040, 4.0, None),  # it still closes: less than half of 10 N
        (0.022, 10.0, False),  # 2 mm of the stroke of 55 mm: closed upon itself
        (0.075, 0.0, None),
        (math.nan, math.nan, None),
    ],
)
def test_fingers_judge_by_opening_and_force(opening, squeeze, held):
    assert FINGERS.held(sight(opening, squeeze), P).held is held


def test_a_gripper_that_closes_on_itself_holds_nothing_whatever_the_pose_says():
    """Pose, gripper, mass in this order; the gripper's veto counts before the pose."""
    yes, no, unknown = Evidence(True, "yes"), Evidence(False, "no"), Evidence(None, "")
    assert fused(sight(0.02, 10.0), yes, no, yes).held is False
    assert fused(sight(0.04, 10.0), yes, unknown, no) == Evidence(True, "yes, no")
    assert fused(sight(0.04, 10.0, tracked=False), unknown, yes, no).held is True
    assert fused(sight(0.04, 10.0, tracked=False), unknown, unknown, no).held is False


@given(st.floats(0.0, 2 * math.pi), st.floats(-1.4, 1.4))
def test_the_axes_of_an_approach_are_a_frame_whose_last_one_points_back(heading, elevation):
    flat = math.cos(elevation)
    way = (flat * math.cos(heading), flat * math.sin(heading), math.sin(elevation))
    axes = Approach(way).axes
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert axes[2] == pytest.approx(np.negative(way)) and np.linalg.det(axes) == pytest.approx(1.0)


def moves(*rows: tuple[str, float, float, float]) -> list[Move]:
    return [Move(*row) for row in rows]


def test_an_approach_from_the_side_is_the_last_move_along_it():
    """From x = 0.6 to 0.8 in 10 to 12 s; back is 0.2 m towards -x. The climb ends at 18 s."""
    path = moves(
        ("z", 0.0, 2.0, 1.0), ("x", 2.0, 8.0, 0.6), ("x", 10.0, 12.0, 0.8), ("z", 16.0, 18.0, 1.2)
    )
    side = Approach((1.0, 0.0, 0.0), (0.0, 0.0, -0.02))
    (window,) = grasp_windows(path, [(13.0, True), (30.0, False)], {13.0: side})
    assert (window.descent, window.lifted, window.departure) == (10.0, 18.0, 31.0)
    assert window.back == pytest.approx((-0.2, 0.0, 0.0)) and window.approach is side
    assert grasp_windows(path, [(13.0, True), (30.0, False)]) == ()  # none from above


def test_the_tip_comes_to_the_stem_and_sets_it_down_at_the_published_places():
    """Pillar of 1.008 m, basket of 0.065 m, claw 0.16 m above its middle: 1.2005 m; down to 10 mm
    less. The tip ends 12 mm behind the stem, from a tenth of a metre before it."""
    vehicle = load_description("t650_gripper")
    scenario, chain = load_scenario("pillars", vehicle), chain_of(vehicle)
    (window,) = grasp_windows(scenario.motions, scenario.magnet, dict(scenario.approaches))
    assert (window.descent, window.lifted) == (21.5, 27.2)
    assert window.back == pytest.approx((-0.1, 0.0, 0.0))
    path = scenario.trajectory(standing(scenario.arm_start))
    chi = path.rows(np.array([window.grip, window.release]), 1)[0]
    tip = hands(chain, chi)[:, :3]
    assert tip[0] == pytest.approx([1.012, 1.0, 1.2005], abs=2e-4)
    assert tip[1] == pytest.approx([-1.012, -1.0, 1.1905], abs=2e-4)


def test_a_payload_beside_the_way_from_the_side_breaks_the_approach_off():
    """The tool is 5 mm before the payload and 40 mm beside it: more than descent_miss, 25 mm."""
    path = moves(
        ("z", 0.0, 2.0, 1.0), ("x", 2.0, 8.0, 0.6), ("x", 10.0, 12.0, 0.8), ("z", 16.0, 18.0, 1.2)
    )
    windows = grasp_windows(path, [(13.0, True)], {13.0: Approach((1.0, 0.0, 0.0))})
    executive = GraspExecutive(windows, 0.2, P)
    payload = np.array([0.8, 0.0, 0.5])
    stamp = 8.0
    while stamp < 10.5:  # it waits before the approach, in its line
        at = Sight(stamp, stamp, payload - [0.2, 0.0, 0.0], payload=payload)
        at.tool[0] += P.press_depth
        executive.step(at)
        stamp += 0.02
    while stamp < 12.0:
        executive.step(Sight(stamp, stamp, payload - [0.005, 0.04, 0.0], payload=payload))
        stamp += 0.02
    assert executive.grasp is Grasp.APPROACHED and "broken off" in executive.decisions[-1].text
    assert executive.directive.pace == -1.0


def test_an_opening_closes_opens_or_is_refused():
    scenario = load_scenario("two_finger", S500)
    numbers = derived_parameters(S500)["mission"]
    mission = Mission(scenario, MissionParameters(**numbers).validated(2))
    assert mission.command_gripper(0.02)[1].startswith("closes until")
    assert mission.command_gripper(0.05)[1].startswith("opens until")
    assert mission.command_gripper(0.08)[1] == "refused: opening 0.08 is outside 0.02 to 0.075"


def test_an_opening_counts_until_the_fingers_close():
    """The stroke is 20 to 75 mm; up to a tenth of it, 25.5 mm, a command closes them."""
    fingers = OpenEnd(S500.gripper.opening)
    assert (fingers.opening, fingers.commanded) == (0.075, False)
    fingers.command(0.04)
    assert (fingers.opening, fingers.commanded) == (0.04, True)
    for closing_or_refused in (0.02, 0.0255, 0.08, math.nan):
        fingers.command(closing_or_refused)
        assert fingers.opening == 0.04
    fingers.switch(False)
    assert fingers.opening == 0.04
    fingers.switch(True)
    assert fingers.opening == 0.075
    fingers.command(0.05)  # opens them from now on
    fingers.switch(True)
    fingers.switch(False)
    assert fingers.opening == 0.05


@pytest.fixture(scope="module")
def closed():
    """The fingers have closed in the air for 1.2 s, at 0.06 m/s: 0.075 - 0.055 m."""
    plant = MujocoPlant(Vehicle.of(S500), 0.0, 1)
    begin = plant.truth().grip[0]
    for _ in range(300):
        plant.step(np.zeros(4), np.zeros(2), True)
    return begin, plant


def test_the_fingers_close_at_their_pace(closed):
    begin, plant = closed
    assert begin == pytest.approx(0.075) and plant.truth().grip[0] == pytest.approx(0.02, abs=1e-4)
    plant.sense()  # the sample of a tick arrives at the next one
    plant.step(np.zeros(4), np.zeros(2), True)
    stamp, grip = plant.sense().grip
    assert grip[0] == pytest.approx(0.02, abs=1e-4) and stamp == pytest.approx(plant.time - 0.004)


def test_they_open_to_a_commanded_opening_within_the_stroke(closed):
    _, plant = closed
    plant.open_to(0.05)
    for _ in range(200):
        plant.step(np.zeros(4), np.zeros(2), False)
    assert plant.truth().grip[0] == pytest.approx(0.05, abs=1e-4)

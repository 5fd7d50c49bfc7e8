"""The entry `environment` of a scenario: bodies of the plant, and what is refused by name."""

from __future__ import annotations

import shutil
from pathlib import Path

import mujoco
import pytest
import yaml

from uam_control.mission import ScenarioError, load_scenario
from uam_control.settings.configuration import path
from uam_control.vehicle import load_description
from uam_lab.flights import clearance
from uam_sim_bridge.plant import Vehicle

S500 = load_description()
HOVER = {
    "arm_start": {"alpha_1_deg": 0, "alpha_2_deg": 90},
    "moves": [{"coordinate": "z", "from": 0, "until": 3, "to": 1.2}],
    "landing": {"at": 5, "duration": 3},
}
ROOM = Path(__file__).resolve().parents[2] / "examples/room.yaml"
BOX, STAND, SHELF = ({"kind": kind, "position": [2, 0]} for kind in ("box", "stand", "shelf"))


def scenario(folder, entries):
    file = folder / "around.yaml"
    file.write_text(yaml.safe_dump(HOVER | {"environment": entries}))
    return load_scenario(str(file), S500)


def compiled(folder, entries, mass=0.2):
    around = scenario(folder, entries).surroundings
    return Vehicle.of(S500).changed(around).compile(mass)


def test_the_usual_environment_is_that_of_the_paper():
    """Stand of 0.727 m at x = -0.789 m with the payload of 4 cm on it, mat of 2 cm at +0.789 m."""
    model = Vehicle.of(S500).compile(0.2)
    assert model.body("payload").pos.tolist() == [-0.789, 0.0, 0.747]
    assert model.body("payload").mass == 0.2
    top = model.geom("stand_top")
    assert top.pos[2] + top.size[2] == pytest.approx(0.727, abs=1e-12)
    assert model.body("stand").pos.tolist() == [-0.789, 0.0, 0.0]
    assert model.body("drop_mat").pos.tolist() == [0.789, 0.0, 0.0]
    assert model.geom("drop_mat").size.tolist() == [0.2, 0.2, 0.01]


def test_every_kind_becomes_bodies_and_stays_where_it_stands():
    """Payloads: 0.6 + 0.015 m on the table; second of three boards of 1.2 m: 0.8 + 0.02 m."""
    room = load_scenario(str(ROOM), S500)
    assert {one["kind"] for one in room.environment} == {
        *("stand", "table", "shelf", "wall", "slope", "box", "mat", "payload")
    }
    model = Vehicle.of(S500).changed(room.surroundings).compile(0.2)
    data = mujoco.MjData(model)
    for _ in range(250):
        mujoco.mj_step(model, data)
    assert data.body("payload").xpos == pytest.approx([-1.2, 0.3, 0.615], abs=1e-3)
    assert data.body("payload_2").xpos == pytest.approx([1.4, 0.0, 0.82], abs=1e-3)
    assert model.body("payload_2").mass == 0.1
    assert model.geom("shelf_board_3").pos[2] == pytest.approx(1.19)  # its upper side is at 1.2


def test_entries_replace_the_usual_ones(tmp_path):
    model = compiled(tmp_path, [{"kind": "box", "position": [2.0, 0.0]}])
    names = [model.body(i).name for i in range(model.nbody)]
    assert "box" in names and "stand" not in names and "drop_mat" not in names
    assert model.body("payload").pos[0] == 50.0  # out of sight: nobody asked for one


def test_an_empty_list_is_an_empty_room_and_no_list_the_usual_one(tmp_path):
    model = compiled(tmp_path, [])
    names = {model.body(i).name for i in range(model.nbody)}
    assert not names & {"stand", "drop_mat"} and model.body("payload").pos[0] == 50.0
    assert scenario(tmp_path, None).surroundings == {}


def test_a_handle_stands_on_the_payload_and_weighs_nothing(tmp_path):
    """Box of 0.1 m, stem of 0.2 m: its middle is 0.05 + 0.1 m above that of the box."""
    size = {"size": [0.1, 0.1, 0.1], "handle": [0.02, 0.03, 0.2]}
    model = compiled(tmp_path, [{"kind": "payload", "position": [2, 0]} | size])
    stem = model.geom("payload_handle")
    assert stem.pos == pytest.approx([0.0, 0.0, 0.15])
    assert stem.size == pytest.approx([0.01, 0.015, 0.1])
    assert stem.contype == model.geom("payload").contype and model.body("payload").mass == 0.2
    assert model.body("payload").ipos == pytest.approx([0.0, 0.0, 0.0])


def test_a_vehicle_file_from_before_loses_its_own_surroundings(tmp_path):
    """It had stand and payload; now they are the scenario's, 1 m farther here."""
    shutil.copytree(path("vehicle/parts"), tmp_path / "parts")
    own = (
        '<body name="stand" pos="-0.789 0 0"><geom name="stand_top" size="0.1"/></body>'
        '<body name="payload" pos="-0.789 0 0.747"><freejoint name="payload"/>'
        '<geom name="payload" size="0.02"/></body></worldbody>'
    )
    model = path("vehicle/s500_arm.xml").read_text().replace("</worldbody>", own)
    (tmp_path / "s500_arm.xml").write_text(model)
    world = tmp_path / "parts/world.xml"
    world.write_text(world.read_text().replace('<body name="environment"/>', ""))
    (tmp_path / "mine.yaml").write_text(path("vehicle/s500_arm.yaml").read_text())
    entries = [
        {"kind": "stand", "position": [-1.789, 0]},
        {"kind": "payload", "rests_on": "stand"},
    ]
    around = scenario(tmp_path, entries).surroundings
    vehicle = Vehicle.of(load_description(tmp_path / "mine.yaml")).changed(around)
    found = vehicle.compile(0.2)
    assert found.body("payload").pos.tolist() == [-1.789, 0.0, 0.747]
    assert found.body("stand").pos[0] == -1.789


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"kind": "tree", "position": [1, 0]}, "environment[0].kind: 'tree' is not one of stand"),
        ({"kind": "box"}, "environment[0].position: missing: [x, y] or [x, y, z] in m"),
        ({"kind": "box", "position": [1, float("nan")]}, "position: nan is not finite"),
        ({"kind": "box", "position": [1, 0, -0.1]}, "position: -0.1 m is below the ground"),
        ({"kind": "box", "position": [999, 0]}, "position: [999.0, 0.0]: at most 50 m away"),
        ({"kind": "box", "position": [1, 0], "size": [1, 0, 1]}, "size: [1.0, 0.0, 1.0]: lengths"),
        ({"kind": "box", "position": [1, 0], "height": 1}, "environment[0].height: unknown"),
        ({"kind": "box", "position": [1, 0], "material": "gold"}, "material: 'gold' is not one of"),
        ({"kind": "slope", "position": [1, 0], "angle_deg": 80}, "angle_deg: 80; at most 60"),
        ({"kind": "payload", "rests_on": "moon"}, "rests_on: no entry stands before it"),
        ({"kind": "payload", "position": [1, 0], "mass": 6}, "mass: 6 kg; 0 to 5 kg"),
    ],
)
def test_an_entry_is_refused_in_one_line(tmp_path, entry, said):
    with pytest.raises(ScenarioError) as error:
        scenario(tmp_path, [entry])
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ([{"kind": "box", "position": [0.1, 0.1]}], "box and the vehicle intersect by 0.064 m"),
        (
            [{"kind": "box", "position": [1.8, 0]}, {"kind": "table", "position": [2.2, 0.3]}],
            "box and table intersect by",
        ),
        (
            [BOX, {"kind": "box", "position": [3, 0], "name": "box"}],
            "environment[1].name: 'box' is the name of another entry",
        ),
        (
            [STAND, {"kind": "payload", "rests_on": "stand", "position": [2.2, 0]}],
            "position: [2.2, 0.0] is beside stand",
        ),
        (
            [SHELF, {"kind": "payload", "rests_on": "shelf", "board": 4}],
            "board: 4; shelf has 3",
        ),
        (
            [{"kind": "wall", "position": [2, 0]}, {"kind": "payload", "rests_on": "wall"}],
            "rests_on: nothing stands on a wall",
        ),
    ],
)
def test_entries_that_do_not_fit_together_are_refused_by_name(tmp_path, entries, said):
    with pytest.raises(ScenarioError) as error:
        clearance.check_standing(S500, scenario(tmp_path, entries))
    assert said in str(error.value)


def test_what_touches_does_not_intersect():
    clearance.check_standing(S500, load_scenario(str(ROOM), S500))


BESIDE = {"kind": "box", "size": [0.2, 0.2, 2.0]}


@pytest.mark.parametrize(
    ("y", "said"),
    [(0.3, "leads through box"), (0.42, "passes box within 0.0"), (1.5, "")],
)
def test_what_the_reference_comes_near_is_a_note(tmp_path, y, said):
    found = "".join(
        clearance.notes(S500, scenario(tmp_path, [BESIDE | {"position": [0.0, y]}]), 0.0)
    )
    assert said in found and bool(said) is bool(found)


@pytest.mark.parametrize(
    ("x", "said"), [(-0.789, ""), (-0.889, "closes 0.10 m from the payload: x +0.10")]
)
def test_a_tool_that_closes_beside_the_payload_is_a_note(tmp_path, x, said):
    """As with an arm of other lengths than those for which the scenario was written."""
    moved = yaml.safe_load(path("scenarios/quick_pick.yaml").read_text())
    stand = {"kind": "stand", "position": [x, 0.0]}
    moved["environment"] = [stand, {"kind": "payload", "rests_on": "stand"}]
    file = tmp_path / "moved.yaml"
    file.write_text(yaml.safe_dump(moved))
    found = "; ".join(clearance.notes(S500, load_scenario(str(file), S500), 0.2))
    assert said in found and bool(said) is bool(found)
    assert not clearance.notes(S500, load_scenario(str(file), S500), 0.0)


@pytest.mark.parametrize(
    ("vehicle", "name"),
    [
        ("s500_arm", "pick_and_place"),
        ("s500_gripper", "two_finger_side"),
        ("t650_gripper", "pillars"),
    ],
)
def test_the_tools_here_close_at_the_payload(vehicle, name):
    described = load_description(vehicle)
    scenario = load_scenario(name, described)
    assert not any("closes" in one for one in clearance.notes(described, scenario, 0.2))

"""An arm that reaches through the ground, at the take-off, at the landing and stowed; refused."""

import math

import mujoco
import numpy as np
import pytest
import yaml

from uam_control.mission import ScenarioError, load_scenario
from uam_control.settings import configuration
from uam_control.vehicle import VehicleError, load_description
from uam_lab.flights import clearance
from uam_lab.flights.flight_settings import settings
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.arm_geometry import room_below

S500 = load_description()
STANDS = "moves: [{coordinate: z, from: 0, until: 3, to: 1.2}]\nlanding: {at: 6, duration: 5}\n"
DOWN = "arm_start: {alpha_1_deg: 0, alpha_2_deg: 0}\n"
UNFOLDS = "moves: [{coordinate: alpha_2, from: 3, until: 5, to_deg: 0}]\n"


def room(vehicle, *degrees):
    model = Vehicle.of(vehicle).compile(0.0)
    return room_below(model, vehicle.joint_names, np.radians(degrees))


def test_the_room_of_the_s500():
    # feet 0.280 m below the base; mount 0.073, links 0.100 and 0.140, magnet 0.030 that hangs
    assert room(S500, 0, 0) == pytest.approx(0.280 - 0.343, abs=1e-6)
    assert room(S500, 0, 90) == pytest.approx(0.280 - 0.203, abs=1e-6)
    assert room(S500, 60, 0) == pytest.approx(0.280 - 0.103 - 0.120, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            DOWN + STANDS,
            "arm_start: with joints at 0, 0 deg the arm reaches 0.063 m below the feet",
        ),
        (UNFOLDS + "landing: {at: 6, duration: 5}\n", "landing: with joints at 0, 0 deg the arm"),
        (STANDS, ""),
        (DOWN.replace("alpha_1_deg: 0", "alpha_1_deg: 65") + STANDS, ""),  # 2 cm of room
    ],
)
def test_a_scenario_that_stands_on_its_arm_is_refused(tmp_path, text, message):
    file = tmp_path / "made.yaml"
    file.write_text(text)
    scenario = load_scenario(str(file))
    if not message:
        clearance.check_standing(S500, scenario)
        return
    with pytest.raises(ScenarioError, match=message) as error:
        clearance.check_standing(S500, scenario)
    assert "\n" not in str(error.value)


def changed_vehicle(folder, edit, mjcf=lambda text: text):
    """A copy of the S-500 with its numbers changed by `edit`, and the text of its gear by mjcf."""
    parts = folder / "parts"
    parts.mkdir()
    for part in S500.file.parent.glob("parts/*"):
        (parts / part.name).write_text(part.read_text())
    gear = parts / "landing_gear.xml"
    gear.write_text(mjcf(gear.read_text()))
    (folder / S500.model.name).write_text(S500.model.read_text())
    numbers = yaml.safe_load(S500.file.read_text())
    edit(numbers)
    file = folder / "mine.yaml"
    file.write_text(yaml.safe_dump(numbers))
    return load_description(str(file))


def test_a_vehicle_that_stows_its_arm_below_its_feet_is_refused(tmp_path):
    vehicle = changed_vehicle(tmp_path, lambda numbers: numbers["joints"][1].update(stowed_deg=0))
    with pytest.raises(VehicleError, match=r"mine.yaml: joints: stowed: .* 0.063 m below the feet"):
        settings("hover", engine="direct", vehicle=str(vehicle.file))


def test_an_mjcf_without_feet_is_not_judged(tmp_path):
    def no_feet(text):
        return "\n".join(line for line in text.splitlines() if "foot" not in line)

    vehicle = changed_vehicle(
        tmp_path, lambda numbers: numbers["joints"][1].update(stowed_deg=0), no_feet
    )
    assert room(vehicle, 0, 0) is None
    clearance.check_standing(vehicle, load_scenario("hover", vehicle))


FOOT = 'pos="0.1 0.1 -0.2" contype="2" conaffinity="5" mass="0"'
SHAPES = [  # of a gear without names, its lowest point below the base [m]
    (f'<geom type="sphere" size="0.02" {FOOT}/>', 0.22),
    (f'<geom type="box" size="0.02 0.02 0.1" euler="90 0 0" {FOOT}/>', 0.22),
    (f'<geom type="capsule" size="0.02 0.1" euler="60 0 0" {FOOT}/>', 0.27),
    (f'<geom type="cylinder" size="0.02 0.1" euler="90 0 0" {FOOT}/>', 0.22),
    (f'<geom type="ellipsoid" size="0.02 0.03 0.1" euler="90 0 0" {FOOT}/>', 0.23),
    (f'<body pos="0 0 -0.1" euler="180 0 0"><geom type="sphere" size="0.02" {FOOT}/></body>', None),
]


@pytest.mark.parametrize(("shape", "depth"), SHAPES)
def test_a_gear_of_any_shape_counts(tmp_path, shape, depth):
    vehicle = changed_vehicle(
        tmp_path, lambda numbers: None, lambda text: f"<mujocoinclude>{shape}</mujocoinclude>"
    )
    depth = -0.1 + 0.02 if depth is None else depth  # 0.1 down and, upside down, 0.2 up again
    assert room(vehicle, 0, 90) == pytest.approx(depth - 0.203, abs=1e-6)


def test_a_gear_of_a_mesh_counts(tmp_path):
    corners = "0 0 0  0.1 0 0  0 0.1 0  0 0 -0.24"
    model = f"""<mujoco><asset><mesh name="leg" vertex="{corners}"/></asset><worldbody>
        <geom type="plane" size="1 1 1"/>
        <body name="base"><freejoint name="base"/><geom type="mesh" mesh="leg" mass="1"/>
        <body><joint name="a" axis="0 -1 0"/><geom type="sphere" size="0.01" mass="1"/>
        <body pos="0 0 -0.1"><joint name="magnet_swing" axis="0 -1 0" range="-60 60"/>
        <geom type="sphere" size="0.01" mass="1"/><site name="magnet_face" pos="0 0 -0.05"/>
        </body></body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(model)
    assert room_below(model, ("a",), (0.0,)) == pytest.approx(0.24 - 0.15, abs=1e-6)
    # the pivot turns back by 60 of 90 deg
    hangs = 0.05 * math.cos(math.radians(30))
    assert room_below(model, ("a",), (math.pi / 2,)) == pytest.approx(0.24 - hangs, abs=1e-6)


@pytest.mark.parametrize("name", ["s500_arm", "s500_arm3", "hexa_arm"])
def test_every_vehicle_and_scenario_here_stands_on_its_feet(name):
    vehicle, flown = load_description(name), 0
    for scenario in configuration.names("scenarios", (".yaml", ".csv")):
        try:
            loaded = load_scenario(scenario, vehicle)
        except ScenarioError:
            continue  # for another arm
        clearance.check_standing(vehicle, loaded)
        flown += 1
    assert flown > 5

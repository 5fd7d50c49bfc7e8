"""The T650 of another laboratory: belief in its vehicle file, truth in its presets."""

import math

import numpy as np
import pytest

from uam_control.arm.kinematics import DOWN, hand_pose, vehicle_centre
from uam_control.mission import ScenarioError, load_scenario
from uam_control.settings import configuration
from uam_control.vehicle import VehicleError, chain_of
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.actuators import rotor_step
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.urdf import urdf

VEHICLE = Vehicle.load("t650")
DESCRIBED = VEHICLE.description


def plant(*names):
    return MujocoPlant(VEHICLE.changed({"effects": presets.read(names)}), 0.0, 1)


def test_the_hand_and_the_centre_of_mass_are_where_that_laboratory_has_them():
    # its law at the home pose: 0, 40, 40, 0 deg (docs/plant.md, tp)
    chain, home = chain_of(DESCRIBED), np.radians([0.0, 40.0, 40.0, 0.0])
    position, _ = hand_pose(chain, home, DOWN)
    assert position == pytest.approx([0.2528986, -0.001565, -0.0606893], abs=1e-7)
    centre = vehicle_centre(chain, home, DOWN)
    assert centre == pytest.approx([0.0194958, -0.0000858, -0.0144882], abs=1e-7)


def test_the_curve_of_the_thrust_is_that_of_its_linear_speed_within_a_hundredth():
    # speed 64.0603 + 665.9904 u rad/s of 730.0507; T/Tmax = 0.82 u^2 + 0.18 u
    u = np.linspace(0.0, 1.0, 101)
    linear = ((64.0603 + 665.9904 * u) / 730.0507) ** 2
    f = DESCRIBED.rotor.curve_factor
    assert np.abs(f * u**2 + (1.0 - f) * u - linear).max() < 0.01
    assert f * 0.36 + (1.0 - f) * 0.6 == pytest.approx(
        ((64.0603 + 665.9904 * 0.6) / 730.0507) ** 2, abs=1e-3
    )


def test_the_mirror_hovers_at_another_command_and_turns_less_in_yaw():
    believed, true = plant(), plant("t650_mirror")
    for one in (believed, true):
        for _ in range(500):
            rotor_step(np.full(4, 0.607), one.rotors.arrays, np.zeros(4))
    # kf 4.1908e-5, w = 64.0603 + 665.9904 0.607 = 468.3 rad/s: 4 rotors carry 3.746 kg
    assert 4.0 * true.rotors.thrust[0] == pytest.approx(4 * 4.1908e-5 * 468.3**2, rel=1e-3)
    assert 4.0 * true.rotors.thrust[0] == pytest.approx(3.746 * 9.81, rel=0.01)
    ratio = true.model.actuator("rotor_1").gear[5] / believed.model.actuator("rotor_1").gear[5]
    assert ratio == pytest.approx(5.772e-7 / 4.1908e-5 / 0.018164, rel=1e-3)


def test_the_mirror_s_centre_of_mass_is_where_the_flights_have_it():
    base = plant("t650_mirror").model.body("base")
    assert base.ipos == pytest.approx([-0.000309 - 0.017854, -0.00001, 0.041789], abs=1e-6)


def test_the_stress_plant_weighs_a_tenth_more():
    one = plant("t650_stress")
    masses = one.model.body_subtreemass
    assert masses[one.model.body("base").id] == pytest.approx(1.1 * 3.746174, rel=1e-3)


@pytest.mark.parametrize("preset", ["t650_mirror", "t650_stress", "laboratory"])
def test_its_plants_stay_finite(preset):
    one = plant(preset)
    for tick in range(100):
        one.sense()
        one.step(np.full(4, 0.6), np.full(4, 0.2 * math.sin(tick)), True)  # it has no magnet
    assert np.all(np.isfinite(one.truth().state)) and one.truth().magnet_force == 0.0


def test_a_scenario_with_a_magnet_is_refused(tmp_path):
    file, hover = tmp_path / "pick.yaml", configuration.named("scenarios", "hover").read_text()
    file.write_text(hover + "magnet:\n  - {at: 5, energised: true}\n")
    with pytest.raises(ScenarioError, match="magnet: t650 has no gripper"):
        load_scenario(str(file), DESCRIBED)
    assert load_scenario(str(file)).magnet


def test_a_vehicle_without_a_magnet_has_a_description_for_other_tools():
    assert "alpha_4" in urdf(VEHICLE) and "magnet" not in urdf(VEHICLE)


def test_a_load_needs_a_magnet_to_hang_on():
    with pytest.raises(VehicleError, match=r"variation.tip_mass: 0.1 kg hang on the magnet"):
        VEHICLE.changed({"variation.tip_mass": 0.1}).compile(0.0)

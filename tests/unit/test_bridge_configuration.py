"""config/bridge and config/autopilot agree with the code's defaults and with each other."""

import pytest
import yaml

from uam_control.settings.configuration import path
from uam_control.settings.parameter_set import ParameterSet
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.offboard.hold import HoldParameters
from uam_sim_bridge.mavlink.offboard.sequence import OffboardParameters
from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.offboard.thrust_identification import ThrustIdentificationParameters
from uam_sim_bridge.mavlink.telemetry.parameter_check import WATCHED, differences, expected
from uam_sim_bridge.plant import Vehicle

BRIDGE = yaml.safe_load(path("bridge/bridge.yaml").read_text())["mavlink_bridge"]["ros__parameters"]


@pytest.mark.parametrize(
    "kind",
    [RateThrustParameters, OffboardParameters, HoldParameters, ThrustIdentificationParameters],
)
def test_the_file_holds_the_defaults(kind: type[ParameterSet]):
    given = {name: value for name, value in BRIDGE.items() if name in kind.specs()}
    assert set(given) == set(kind.specs())
    assert kind.from_mapping(given) == kind().validated()


def test_autopilot_file_is_what_the_bridge_assumes():
    autopilot = Parameters.load(path("autopilot/s500.yaml"))
    values = {name: autopilot[name] for name in WATCHED}
    assert list(differences(RateThrustParameters(), values)) == []
    for name in expected(RateThrustParameters()):
        assert name in WATCHED
    px, py, km = autopilot.rotors()
    assert abs(px[0]) == BRIDGE["rotor_arm_x"] and abs(py[0]) == BRIDGE["rotor_arm_y"]
    assert abs(km[0]) == BRIDGE["rotor_moment_ratio"]


def test_plant_file_is_what_the_bridge_assumes():
    rotors = yaml.safe_load(path("vehicle/s500_arm.yaml").read_text())["rotors"]
    full = rotors["thrust_coefficient"] * rotors["speed_max"] ** 2
    assert full == pytest.approx(BRIDGE["rotor_thrust_max"], rel=1e-3)
    assert rotors["curve_factor"] == BRIDGE["motor_curve_factor"]


def test_the_vehicle_weighs_what_the_bridge_assumes():
    model = Vehicle.load().compile(0.0)
    base = model.body_subtreemass[model.body("base").id]
    assert base == pytest.approx(BRIDGE["identification_mass"], rel=1e-3)


def test_differences_are_named():
    found = list(differences(RateThrustParameters(), {"MC_ROLLRATE_P": 0.3, "THR_MDL_FAC": 0.0}))
    assert found == [
        "THR_MDL_FAC is 0 on the autopilot, the bridge assumes 0.3",
        "MC_ROLLRATE_P is 0.3 on the autopilot, the bridge assumes 0.15",
    ]
    assert list(differences(RateThrustParameters(), {"MC_ROLLRATE_P": 0.15000001})) == []

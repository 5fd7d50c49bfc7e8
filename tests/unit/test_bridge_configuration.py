"""config/bridge agrees with the code's defaults; what follows from the vehicle is consistent."""

import pytest
import yaml

from uam_control.offboard.autopilot_magnet import AutopilotMagnetParameters
from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.setpoints.level_hold import HoldParameters
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.setpoints.setpoint_types import SetpointParameters
from uam_control.setpoints.thrust_identification import ThrustIdentificationParameters
from uam_control.settings.configuration import path
from uam_control.settings.parameter_set import ParameterSet
from uam_control.vehicle import derived_parameters, load_description
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.devices.magnet.lines import SwitchingParameters
from uam_sim_bridge.mavlink.telemetry.parameter_check import differences, expected

BRIDGE = yaml.safe_load(path("bridge/bridge.yaml").read_text())["mavlink_bridge"]["ros__parameters"]
VEHICLE = load_description()
DERIVED = derived_parameters(VEHICLE)["mavlink_bridge"]


@pytest.mark.parametrize(
    "kind",
    [
        RateThrustParameters,
        OffboardParameters,
        HoldParameters,
        SetpointParameters,
        ThrustIdentificationParameters,
        AutopilotMagnetParameters,
        SwitchingParameters,
    ],
)
def test_the_file_holds_the_defaults(kind: type[ParameterSet]):
    given = {name: value for name, value in BRIDGE.items() if name in kind.specs()}
    follows = {name: value for name, value in DERIVED.items() if name in kind.specs()}
    assert set(given) | set(follows) == set(kind.specs())
    assert not set(given) & set(follows), "what follows from the vehicle stands nowhere else"
    assert kind.from_mapping(follows | given) == kind(**follows).validated()


def test_the_autopilot_flies_what_the_bridge_assumes():
    autopilot, mapping = Parameters.of(VEHICLE), RateThrustParameters.of(VEHICLE)
    values = {name: autopilot[name] for name in FIRMWARES["px4"].watched}
    assert list(differences(mapping, values)) == []
    assert set(expected(mapping)) <= set(FIRMWARES["px4"].watched)


def test_differences_are_named():
    mapping = RateThrustParameters.of(VEHICLE)
    found = list(differences(mapping, {"MC_ROLLRATE_P": 0.3, "THR_MDL_FAC": 0.0}))
    assert found == [
        "THR_MDL_FAC is 0 on the autopilot, the bridge assumes 0.3",
        "MC_ROLLRATE_P is 0.3 on the autopilot, the bridge assumes 0.15",
    ]
    assert list(differences(mapping, {"MC_ROLLRATE_P": 0.15000001})) == []

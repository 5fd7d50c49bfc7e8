"""The read-only parameters `vehicle` and `scenario` of a node, names or files, and what follows."""

import numpy as np
from rclpy.node import Node

from uam_control.arm.hand import hands
from uam_control.mission import Scenario, ScenarioError, ScenarioOptions, load_scenario
from uam_control.mission.motion.flatness import Flyer
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError, Text
from uam_control.stages.tick_stamps import Timing
from uam_control.vehicle import DEFAULT_VEHICLE, VehicleDescription, VehicleError, load_description
from uam_msgs_py.messages.navigation import hand_message
from uam_msgs_py.node.node_parameters import NodeParameters, declared_text

PARAMETER = "vehicle"
DEFAULT_SCENARIO = "pick_and_place"


def described_vehicle(node: Node) -> VehicleDescription:
    """Declare the parameter and return the description it names. Raises ParameterError."""
    about = Text("description of the vehicle", "name of a file in config/vehicle, or a file")
    given = declared_text(node, PARAMETER, DEFAULT_VEHICLE, about)
    try:
        return load_description(given)
    except (VehicleError, ConfigurationError) as error:
        raise ParameterError(f"{PARAMETER}: {error}") from None


def described_scenario(node: Node, vehicle: VehicleDescription) -> Scenario:
    """Declare `scenario` and its options, and return the scenario. Raises ParameterError."""
    about = Text("what is flown", "name of a file in config/scenarios, or a file")
    name = declared_text(node, "scenario", DEFAULT_SCENARIO, about)
    options = NodeParameters(node, ScenarioOptions, read_only=True).current
    try:
        return load_scenario(name, vehicle, options)
    except ScenarioError as error:
        raise ParameterError(f"scenario: {error}") from None


def described_timing(node: Node, vehicle: VehicleDescription) -> Timing:
    """Declare the parameters of the control ticks; their period is the vehicle's by default."""
    own = {"control_period": vehicle.control_period}
    return NodeParameters(node, Timing, (), own, read_only=True).current


def described_hand(vehicle: VehicleDescription) -> Flyer | None:
    """Return what flies an end effector, None without one; compiles what a hand needs."""
    flyer = Flyer.with_hand(vehicle)
    if flyer is not None:
        chi = np.zeros((1, len(vehicle.coordinates)))
        hand_message(0, flyer.chain, chi[0])
        hands(flyer.chain, chi)
    return flyer

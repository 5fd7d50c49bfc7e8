"""The read-only parameter `vehicle` of a node: the name or file of the vehicle description."""

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import (
    DEFAULT_VEHICLE,
    VehicleDescription,
    VehicleError,
    load_description,
)

PARAMETER = "vehicle"


def described_vehicle(node: Node) -> VehicleDescription:
    """Declare the parameter and return the description it names. Raises ParameterError."""
    about = ParameterDescriptor(
        description="name of a file in config/vehicle, or a file; fixed once the node runs",
        read_only=True,
    )
    given = node.declare_parameter(PARAMETER, DEFAULT_VEHICLE, about).value
    try:
        return load_description(given)
    except (VehicleError, ConfigurationError) as error:
        raise ParameterError(f"{PARAMETER}: {error}") from None

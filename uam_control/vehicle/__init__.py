"""The description of a vehicle: the file in config/vehicle/ and the values derived from it."""

from uam_control.vehicle.chain_reader import chain_and_hinge, chain_of, model_spec
from uam_control.vehicle.derived_parameters import derived_parameters
from uam_control.vehicle.description import (
    AXES,
    CURRENT_SERVO,
    GRAVITY,
    POSITION_SERVO,
    SERVO_MODES,
    Joint,
    Servo,
    VehicleDescription,
)
from uam_control.vehicle.gripper import NO_GRIPPER, TWO_FINGER, OpenEnd, closes
from uam_control.vehicle.loading import (
    AUTOPILOT_FILE,
    DEFAULT_VEHICLE,
    PROFILE_FILE,
    VehicleError,
    designed,
    load_description,
)

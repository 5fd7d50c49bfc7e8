"""The description of a vehicle: what is written once, under config/vehicle/, and what follows."""

from uam_control.vehicle.description import Joint, Rotor, RotorModel, Servo, VehicleDescription
from uam_control.vehicle.loading import DEFAULT_VEHICLE, VehicleError, load_description

__all__ = [
    "DEFAULT_VEHICLE",
    "Joint",
    "Rotor",
    "RotorModel",
    "Servo",
    "VehicleDescription",
    "VehicleError",
    "load_description",
]

"""The vehicle and its surroundings in MuJoCo, with sensors and actuators as the real ones
behave."""

from uam_sim_bridge.plant.plant import Plant, Samples, Truth
from uam_sim_bridge.plant.vehicle import Vehicle

__all__ = ["Plant", "Samples", "Truth", "Vehicle"]

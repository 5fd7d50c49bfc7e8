"""The vehicle and its surroundings, with sensors and actuators as the real ones behave."""

from uam_sim_bridge.plant.plant import Disturbance, Plant, Samples, Truth
from uam_sim_bridge.plant.vehicle import Vehicle

__all__ = ["Disturbance", "Plant", "Samples", "Truth", "Vehicle"]

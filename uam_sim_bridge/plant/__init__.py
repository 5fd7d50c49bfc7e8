"""Simulated vehicle and surroundings, with models of sensors and actuators."""

from uam_sim_bridge.plant.plant import Disturbance, Plant, Samples, Truth, TruthRow
from uam_sim_bridge.plant.vehicle import Vehicle

__all__ = ["Disturbance", "Plant", "Samples", "Truth", "TruthRow", "Vehicle"]

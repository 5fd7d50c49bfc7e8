"""Simulated vehicle and surroundings, with models of sensors and actuators."""

from uam_sim_bridge.plant.plant import (
    Disturbance,
    PhysicsError,
    Plant,
    Samples,
    Truth,
    TruthRow,
    warm_up,
)
from uam_sim_bridge.plant.vehicle import Vehicle

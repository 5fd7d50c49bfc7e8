"""A plant with effects, and what is seen of it."""

import math

import numpy as np

from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant


def plant(*specs, seed=1, vehicle="s500_arm", payload=0.2):
    effects = presets.read((), specs)
    return MujocoPlant(Vehicle.load(vehicle).changed({"effects": effects}), payload, seed)


def flown(one, ticks=60, command=0.6):
    """Return the samples and the true states of some ticks with constant commands."""
    rotors, samples, states = len(one.vehicle.description.rotors), [], []
    for tick in range(ticks):
        samples.append(one.sense())
        states.append(one.truth().state)
        one.step(np.full(rotors, command), np.full(one.joints, 0.3 * math.sin(tick)), False)
    return samples, np.array(states)


def tick(one, name):
    """Let one effect act before a control period."""
    acting = one.effects.acting[name]
    one.effects.draw()
    acting.steps["tick"](acting.arrays)


def column(samples, kind):
    return [s and np.concatenate([np.atleast_1d(x) for x in s]) for s in map(kind, samples)]


def same(a, b):
    return len(a) == len(b) and all(
        (x is None and y is None) or (x is not None and y is not None and np.array_equal(x, y))
        for x, y in zip(a, b, strict=True)
    )

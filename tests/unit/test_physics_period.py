"""A control period in one compiled call is the same as its physics steps one by one."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.vehicle import load_description
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.physics import actuate, average, begin_period
from uam_sim_bridge.plant.plant import check_arrays

VEHICLES = {name: Vehicle.of(load_description(name)) for name in ("s500_arm3", "hexa_arm")}


def one_by_one(plant, motors, effort, magnet):
    """As `MujocoPlant.step`, with MuJoCo's own step."""
    due = plant._command_delay(plant.tick, tuple(effort))
    if due is not None:
        plant.servos.take(due)
    begin_period(plant._arrays, magnet)
    for _ in range(plant._steps):
        actuate(plant._arrays, motors)
        mujoco.mj_step(plant.model, plant.data)
        average(plant._arrays, 1.0 / plant._steps)
    plant.tick += 1


@pytest.mark.parametrize("name", VEHICLES)
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_bit_for_bit(name, seed, magnet):
    one, other = (MujocoPlant(VEHICLES[name], 0.2, seed=1) for _ in range(2))
    drawn = np.random.default_rng(seed)
    for _ in range(20):
        motors = drawn.uniform(0.0, 1.0, len(one.rotors.speed))
        effort = drawn.uniform(-1.0, 1.0, one.joints)
        one.step(motors, effort, magnet)
        one_by_one(other, motors, effort, magnet)
        for part in ("qpos", "qvel", "qacc", "ctrl", "sensordata", "xfrc_applied"):
            assert np.array_equal(getattr(one.data, part), getattr(other.data, part)), part
        first, second = one.sense(), other.sense()
        assert np.array_equal(first.hil[1], second.hil[1])
        assert np.array_equal(first.hil[2], second.hil[2])
    assert one.truth().state[0, 2] != 0.0 and one.data.time == pytest.approx(20 * one.period)


@pytest.mark.parametrize(
    "bad", [np.zeros(3, dtype=np.float32), np.zeros((3, 2))[:, 0], [0.0, 0.0, 0.0]]
)
def test_a_sample_that_compiled_code_would_misread_is_refused(bad):
    check_arrays((np.zeros(3), np.zeros(2)))
    with pytest.raises(TypeError, match="contiguous array of float64"):
        check_arrays((np.zeros(3), bad))

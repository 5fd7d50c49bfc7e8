"""The plant against Newton's and Euler's equations of the generated URDF, and closed forms."""

from __future__ import annotations

import mujoco
import newton_euler
import numpy as np
import pytest

from uam_control.maths.rotations import matrix_from_quaternion
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.urdf import urdf

VEHICLE = Vehicle.load()
BODIES = newton_euler.links(urdf(VEHICLE))
ROTOR = VEHICLE.description.rotor
TREE = 9  # dof of base, arm and magnet


def bare_model():
    """The vehicle with the additions that URDF cannot carry (friction, armature) taken out."""
    model = VEHICLE.compile(0.2)
    model.dof_armature[:] = model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
    return model


def random_pose(seed):
    """Return MuJoCo (qpos, qvel) of the vehicle."""
    rng = np.random.default_rng(seed)
    quaternion = rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    position, joints = rng.uniform(-1, 1, 3) + [0, 0, 3], rng.uniform(-1.5, 1.5, 3)
    return np.concatenate([position, quaternion, joints]), rng.standard_normal(TREE)


@pytest.mark.parametrize("seed", range(10))
def test_mass_matrix_gravity_and_coupling_are_newtons_and_eulers(seed):
    """The plant's MJCF against the generated URDF, without MuJoCo: tests/newton_euler.py."""
    model = bare_model()
    data = mujoco.MjData(model)
    q, v = random_pose(seed)
    data.qpos[:10], data.qvel[:TREE] = q, v
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    turn = matrix_from_quaternion(q[3:7])
    expected, bias = newton_euler.equations(BODIES, q[:3], turn, q[7:], v)
    np.testing.assert_allclose(mass[:TREE, :TREE], expected, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(data.qfrc_bias[:TREE], bias, rtol=1e-6, atol=1e-7)


def test_total_mass_is_the_papers():
    model = VEHICLE.compile(0.2)
    base = model.body("base").id
    assert model.body_subtreemass[base] == pytest.approx(2.2, abs=1e-9)


def test_free_fall():
    model = bare_model()
    data = mujoco.MjData(model)
    data.qpos[2] = 50.0
    for _ in range(500):
        mujoco.mj_step(model, data)
    centre = data.subtree_com[model.body("base").id]
    start = mujoco.MjData(model)
    start.qpos[2] = 50.0
    mujoco.mj_forward(model, start)
    fallen = start.subtree_com[model.body("base").id][2] - centre[2]
    assert fallen == pytest.approx(0.5 * 9.81 * 1.0**2, rel=5e-3)  # one step of integrator error


def test_energy_is_kept_without_losses():
    model = bare_model()
    model.opt.timestep = 1e-4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    q, v = random_pose(3)
    data.qpos[:10], data.qvel[:TREE] = q, v
    data.qpos[2] = 30.0
    data.qpos[7:10] = 0.3
    mujoco.mj_forward(model, data)
    before = data.energy.sum()
    for _ in range(3000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert data.energy.sum() == pytest.approx(before, abs=1e-4 * abs(before))


def test_hover_thrust_is_the_weight():
    """Level, arm at the pose where its weight is balanced: weight in thrust keeps it in the air."""
    plant = MujocoPlant(VEHICLE, 0.0, seed=1, arm_start=(0.0, 0.0))
    thrust = 2.2 * 9.81 / 4.0 / ROTOR.thrust_max
    factor = VEHICLE.numbers["rotors"]["curve_factor"]
    command = (-(1 - factor) + np.sqrt((1 - factor) ** 2 + 4 * factor * thrust)) / (2 * factor)
    plant.rotors.speed[:] = np.sqrt(
        thrust * ROTOR.thrust_max / VEHICLE.numbers["rotors"]["thrust_coefficient"]
    )
    plant.data.qpos[2] = 5.0
    for _ in range(250):
        plant.sense()
        plant.step(np.full(4, command), np.zeros(2), False)
    state = plant.truth().state
    assert state[0, 2] == pytest.approx(5.0, abs=2e-3)
    assert abs(state[1, 2]) < 2e-3
    assert np.all(np.abs(state[0, 3:6]) < 1e-3)


def test_accelerometer_at_rest_feels_the_ground():
    vehicle = VEHICLE.changed({"sensors.noise_scale": 0.0})
    plant = MujocoPlant(vehicle, 0.2, seed=1)
    effort = np.zeros(2)
    for _ in range(500):
        hil = plant.sense().hil
        effort[:] = (
            -2.0 * (plant.truth().state[0, 6:8] - [0.0, np.pi / 2])
            - 0.2 * (plant.truth().state[1, 6:8])
        )
        plant.step(np.zeros(4), effort, False)
    np.testing.assert_allclose(hil[2], [0.0, 0.0, 9.81], atol=0.05)

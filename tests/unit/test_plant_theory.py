"""The plant against theory that is not ours: pinocchio on the generated URDF, and closed forms."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from uam_control.maths.rotations import matrix_from_quaternion
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.urdf import urdf

pinocchio = pytest.importorskip("pinocchio")

VEHICLE = Vehicle.load()
ROTOR = VEHICLE.description.rotor
TREE = 9  # dof of base, arm and magnet


def bare_model():
    """The vehicle with the additions that URDF cannot carry (friction, armature) taken out."""
    model = VEHICLE.compile(0.2)
    model.dof_armature[:] = model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
    return model


def twin():
    model = pinocchio.buildModelFromXML(urdf(VEHICLE), pinocchio.JointModelFreeFlyer())
    return model, model.createData()


def random_pose(seed):
    """Return MuJoCo (qpos, qvel) of the vehicle and the same for pinocchio."""
    rng = np.random.default_rng(seed)
    quaternion = rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    position, joints = rng.uniform(-1, 1, 3) + [0, 0, 3], rng.uniform(-1.5, 1.5, 3)
    linear, angular, joint_rates = (rng.standard_normal(3) for _ in range(3))
    rotation = matrix_from_quaternion(quaternion)
    q_mujoco = np.concatenate([position, quaternion, joints])
    v_mujoco = np.concatenate([linear, angular, joint_rates])
    q_pin = np.concatenate([position, quaternion[[1, 2, 3, 0]], joints])
    v_pin = np.concatenate([rotation.T @ linear, angular, joint_rates])
    # pinocchio's linear velocity is in the body frame, MuJoCo's in the world frame
    change = np.eye(TREE)
    change[:3, :3] = rotation.T
    return q_mujoco, v_mujoco, q_pin, v_pin, change


@pytest.mark.parametrize("seed", range(10))
def test_mass_matrix_gravity_and_coupling_agree_with_pinocchio(seed):
    model = bare_model()
    data = mujoco.MjData(model)
    q, v, q_pin, v_pin, change = random_pose(seed)
    data.qpos[:10], data.qvel[:TREE] = q, v
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    other, other_data = twin()
    pinocchio.crba(other, other_data, q_pin)
    upper = np.triu(other_data.M)
    theirs = change.T @ (upper + np.triu(upper, 1).T) @ change
    np.testing.assert_allclose(mass[:TREE, :TREE], theirs, rtol=1e-6, atol=1e-8)

    # forces that hold a given acceleration: h = C v + g in pinocchio's coordinates. The world-frame
    # linear acceleration a is R (a_body + omega x v_body).
    bias = pinocchio.nonLinearEffects(other, other_data, q_pin, v_pin)
    transport = np.zeros(TREE)
    transport[:3] = -np.cross(v_pin[3:6], v_pin[:3])
    theirs = change.T @ (bias + (upper + np.triu(upper, 1).T) @ transport)
    np.testing.assert_allclose(data.qfrc_bias[:TREE], theirs, rtol=1e-6, atol=1e-7)


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
    q, v, *_ = random_pose(3)
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

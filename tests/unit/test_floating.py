"""The flying vehicle in decoupled coordinates, and the hand's task, against Pinocchio."""

import numpy as np
from random_chains import chi_of, in_pinocchio, pin, random_chain, random_motion

from uam_control.arm.floating import centre_motion, decoupled, stiff, task_jacobian, write_task
from uam_control.maths.rotations import matrix_from_euler
from uam_control.maths.vectors import rows

FEW = 1e-3  # [s] between two places of a motion that is differentiated


def test_the_inertia_of_random_vehicles_is_diagonal_in_these_coordinates():
    random = np.random.default_rng(2)
    for _ in range(50):
        chain = random_chain(random)
        model, n = in_pinocchio(chain), len(chain.masses)
        q, v, a = random_motion(random, model)
        d = decoupled(chain, q[7:])
        data = model.createData()
        mass = pin.crba(model, data, q)
        mass[6:, 6:] += np.diag(chain.armature)
        to = np.eye(6 + n)
        to[:3, 3:6], to[:3, 6:] = -pin.skew(np.array(d.centre)), d.first
        to[6:, 3:6] = d.coupling
        parts = np.zeros((6 + n, 6 + n))
        parts[:3, :3] = d.mass * np.eye(3)
        parts[3:6, 3:6], parts[6:, 6:] = d.turning, d.joints
        np.testing.assert_allclose(to.T @ parts @ to, mass, atol=1e-10)
        pin.centerOfMass(model, data, q, v, a)
        for got, expected in zip(
            centre_motion(chain, chi_of(model, q, v, a)),
            (data.com[0], data.vcom[0], data.acom[0]),
            strict=True,
        ):
            np.testing.assert_allclose(got, expected, atol=1e-6)


def test_the_task_and_its_derivatives_are_those_of_a_motion():
    random = np.random.default_rng(3)
    for _ in range(20):
        chain = stiff(random_chain(random))
        model = in_pinocchio(chain)
        q, v, a = random_motion(random, model)
        tasks = np.zeros((3, 3, 4))
        for k, time in enumerate((-FEW, 0.0, FEW)):
            at = pin.integrate(model, q, time * v + 0.5 * time**2 * a)
            rates = v + time * a
            write_task(chain, chi_of(model, at, rates, a), tasks[k])
        moved = (tasks[2, 0] - tasks[0, 0]) / (2.0 * FEW)
        np.testing.assert_allclose(tasks[1, 1, :3], moved[:3], atol=1e-4)
        bent = (tasks[2, 1] - tasks[0, 1]) / (2.0 * FEW)
        np.testing.assert_allclose(tasks[1, 2], bent, atol=1e-3)

        chi, d = chi_of(model, q, v, a), decoupled(chain, q[7:])
        turn = rows(matrix_from_euler(chi[0, 3:6]))
        by_turning, by_joints = task_jacobian(chain, d, chi[0, 6:].copy(), turn)
        rho = v[6:] + d.coupling @ v[3:6]
        np.testing.assert_allclose(by_turning @ v[3:6] + by_joints @ rho, tasks[1, 1], atol=1e-8)

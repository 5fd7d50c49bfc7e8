"""Linear model of the plant in hover: rotors, rigid bodies of base, arm, magnet and payload.

The rigid bodies are those of the plant's MuJoCo model without contacts and limits of the joints,
linearised by differences at a level hover in calm air. The motors' lag differs up and down; the
model has the one lag of the same phase at LAG_FREQUENCY. Dry friction of a joint, F, acts on an
oscillation of the speed amplitude V as a damping of 4 F / (pi V) (describing function); the model
has that of V = SLIDING, or none.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.signal import cont2discrete

from uam_control.coordinates import ARM
from uam_control.setpoints.thrust_curve import inverse_curve
from uam_lab.analysis.dynamics import Body
from uam_lab.experiments.margins.linear import LinearBlock, delay, join
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.actuators import Rotors, rotor_step

SLIDING = 0.5  # [rad/s] speed amplitude of a joint's oscillation; less friction acts beyond it
LAG_FREQUENCY = 20.0  # [rad/s] a typical crossover of the attitude loops
CYCLES = 12  # of the sine; the last one is evaluated
CHANGE = 1e-5  # of angles [rad], velocities, thrusts and torques for the differences
SINE = 0.01  # amplitude of the motor command


@dataclass(frozen=True)
class Hover:
    """The operating point: weight [N], and the motor command 0..1 of each rotor for it."""

    weight: float
    command: float


def plant_model(
    vehicle: Vehicle, payload_mass: float, arm: Sequence[float], dry: bool = True
) -> tuple[LinearBlock, Hover]:
    """Return the plant's block for one control period, and the operating point.

    payload_mass [kg], rigid on the magnet; arm (n,): joint angles [rad]; dry: whether the joints
    have their dry friction. Inputs: motor.1 ... the commands 0..1, and effort.<joint> [N m], sent
    at the tick; outputs: true.<coordinate> and true.<coordinate>_dot at the tick, SI units.
    """
    described, numbers = vehicle.description, vehicle.numbers
    names, period = described.coordinates, described.control_period
    body = Body(vehicle, payload_mass)
    a, b = rigid_bodies(body, arm, numbers["air"]["drag"], dry)
    rotors = len(body.rotor_names)
    weight = float(body.model.body_subtreemass[body.model.body("base").id]) * described.gravity
    plant = Rotors(numbers["rotors"], body.model.opt.timestep)
    command, slope, lag = rotor_model(plant, weight / rotors, body.model.opt.timestep)
    # states: angles and velocities, rotor thrusts; inputs: motor commands, efforts
    size, joints = len(a), b.shape[1] - rotors
    whole = np.zeros((size + rotors, size + rotors))
    whole[:size, :size], whole[:size, size:] = a, b[:, :rotors]
    whole[size:, size:] = -np.eye(rotors) / lag
    given = np.zeros((size + rotors, rotors + joints))
    given[:size, rotors:] = b[:, rotors:]
    given[size:, :rotors] = slope / lag * np.eye(rotors)
    coordinates = len(names)
    seen = np.zeros((2 * coordinates, len(whole)))
    seen[:coordinates, :coordinates] = np.eye(coordinates)
    seen[coordinates:, size // 2 : size // 2 + coordinates] = np.eye(coordinates)
    motors = tuple(f"motor.{i + 1}" for i in range(rotors))
    acting, sent = (tuple(f"{one}.{j}" for j in names[ARM]) for one in ("acting", "effort"))
    outputs = (*(f"true.{name}" for name in names), *(f"true.{name}_dot" for name in names))
    none = np.zeros((len(outputs), rotors + joints))
    held = cont2discrete((whole, given, seen, none), period)[:4]
    physics = LinearBlock(*held, (*motors, *acting), outputs)
    bus = delay(sent, acting, numbers["servos"]["command_latency_ticks"])
    return join([physics, bus]), Hover(weight, command)


def rigid_bodies(
    body: Body, arm: Sequence[float], drag: Sequence[float], dry: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B of x' = A x + B u: x displacements and velocities of base, arm and magnet.

    u: thrusts of the rotors [N], torques of the joints [N m]. arm (n,) [rad]; drag (3,) [N s/m];
    dry: see `plant_model`.
    """
    model, data, used = body.model, body.data, body.size + 1
    joints = body.size - 6
    chi = np.zeros(body.size)
    chi[ARM] = arm
    actuators = [model.actuator(name).id for name in body.rotor_names]
    first = max(actuators) + 1
    actuators += range(first, first + joints)
    body.place(chi)
    data.qvel[:] = data.ctrl[:] = 0.0
    start = data.qpos.copy()

    def acceleration(place: np.ndarray, speed: np.ndarray, control: np.ndarray) -> np.ndarray:
        """Return qacc (used,) at a displacement and a velocity (nv,) with controls."""
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, place, 1.0)
        data.qvel[:], data.ctrl[actuators] = speed, control
        mujoco.mj_forward(model, data)
        return data.qacc[:used].copy()

    still, none = np.zeros(model.nv), np.zeros(len(actuators))
    free = acceleration(still, still, none)
    by_control = np.array(
        [acceleration(still, still, row) - free for row in np.eye(len(actuators))]
    ).T
    balance = np.linalg.lstsq(by_control, -free, rcond=None)[0]

    a = np.zeros((2 * used, 2 * used))
    a[:used, used:] = np.eye(used)
    for i in range(used):
        change = np.zeros(model.nv)
        change[i] = CHANGE
        for begin, pair in (
            (0, [acceleration(sign * change, still, balance) for sign in (1.0, -1.0)]),
            (used, [acceleration(still, sign * change, balance) for sign in (1.0, -1.0)]),
        ):
            a[used:, begin + i] = (pair[0] - pair[1]) / (2.0 * CHANGE)
    b = np.vstack([np.zeros_like(by_control), by_control])
    # damping by drag on the base, as in the plant, and by dry friction
    damping = np.zeros(model.nv)
    damping[: len(drag)] = drag
    if dry:
        dofs = slice(body.size - joints, body.size)
        damping[dofs] = 4.0 * model.dof_frictionloss[dofs] / (np.pi * SLIDING)
    acceleration(still, still, balance)
    for i in np.flatnonzero(damping):
        force, by_force = np.zeros((1, model.nv)), np.zeros((1, model.nv))
        force[0, i] = -damping[i]
        mujoco.mj_solveM(model, data, by_force, force)
        a[used:, used + i] += by_force[0, :used]
    return a, b


def rotor_model(plant: Rotors, thrust: float, step: float) -> tuple[float, float, float]:
    """Return command 0..1, slope [N] and lag [s] of a rotor at a thrust [N]; step [s]: of physics.

    The lag is that of the first-order lag with the phase of the rotor at LAG_FREQUENCY.
    """
    count = len(plant.efficiency)
    full, output = float(plant.constants[1]), np.zeros(count)

    def settled(command: float) -> float:
        for _ in range(round(1.0 / step)):
            rotor_step(np.full(count, command), plant.arrays, output)
        return float(np.mean(output))

    command = inverse_curve(plant.constants[4], thrust / (full * np.mean(plant.efficiency)))
    slope = (settled(command + SINE) - settled(command - SINE)) / (2.0 * SINE)
    settled(command)
    cycle = round(2.0 * math.pi / (LAG_FREQUENCY * step))
    total = 0j
    for k in range(CYCLES * cycle):
        phase = 2.0 * math.pi * k / cycle
        rotor_step(np.full(count, command + SINE * math.sin(phase)), plant.arrays, output)
        if k >= (CYCLES - 1) * cycle:  # input and output hold during the same step
            total += np.mean(output) * np.exp(-1j * phase)
    # a sine without lag has the phase -90 degrees here
    behind = -(np.angle(total) + 0.5 * math.pi)
    return command, slope, math.tan(behind) / LAG_FREQUENCY

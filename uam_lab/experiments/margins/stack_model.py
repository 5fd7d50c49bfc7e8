"""Linear model of the stack around hover, from the objects of a flight of the direct engine.

| block | object |
|---|---|
| IMU, joints: latency | numbers of the vehicle |
| estimate of base | exact: IMU and motion capture agree (`estimator_margin` for the rest) |
| estimate of joints | `StateEstimator.joints` |
| hand: correction of the arm's reference | `HandStage`, faded in; only with a `hand_bandwidth` |
| laws, desired attitude, map to the setpoint | stages of `ControlTick`, `RateThrustMap` |
| rate loop, allocation | `Autopilot.rate_loop`; of torque setpoints `Autopilot.allocate` alone |
| rotors, rigid bodies, servos | `plant_model` |
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uam_control.control.hand_steering import FADE
from uam_control.coordinates import ARM, ATTITUDE, CHI, CHI_DDOT, CHI_DOT, Z
from uam_control.frames import swap_body
from uam_control.mission import load_scenario
from uam_control.profiles.profile import CONTROLLERS, Profile
from uam_control.setpoints.setpoint_types import WRENCH
from uam_control.stages.control_tick import (
    control_arm,
    control_attitude,
    control_position,
    control_whole_body,
)
from uam_lab.experiments.margins.linear import LinearBlock, delay, linearise
from uam_lab.experiments.margins.plant_model import Hover, plant_model
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.plant import Vehicle

RATES = ("setpoint.roll", "setpoint.pitch", "setpoint.yaw")  # body rates [rad/s] or torque, FLU
THRUST = "setpoint.thrust"
MODELLED = ("rates", WRENCH)  # setpoint types
LAWS = control_position, control_attitude, control_arm
Gains = Mapping[str, np.ndarray]  # subsystem → adapted gains, the first values of its `adaptation`


@dataclass(frozen=True)
class Stack:
    """All blocks of vehicle and stack; period [s] of the ticks; names of chi's coordinates."""

    blocks: tuple[LinearBlock, ...]
    period: float
    coordinates: tuple[str, ...]


def stack_model(
    profile: Profile,
    vehicle: Vehicle,
    payload_mass: float = 0.0,
    arm: Sequence[float] | None = None,
    gains: Gains | None = None,
    late_setpoints: int = 0,
    dry: bool = True,
) -> Stack:
    """Return the linear model in hover.

    payload_mass [kg] on the magnet; arm (n,) [rad], None: stowed; gains: None for the initial ones;
    late_setpoints [ticks]: more delay of the setpoints on their way to the autopilot;
    dry: see `plant_model`.
    """
    # adaptation is slow, and its gains are given
    sets = profile.sets | {node: profile.sets[node].linear() for node in CONTROLLERS}
    described, numbers = vehicle.description, vehicle.numbers
    scenario = load_scenario("hover", described)
    flight = DirectFlight(scenario, replace(profile, sets=sets), vehicle, 0.0, seed=1)
    posture = described.stowed if arm is None else arm
    plant, hover = plant_model(vehicle, payload_mass, posture, dry)
    wrench = profile.setpoint == WRENCH
    names = described.coordinates
    base = tuple(f"{name}{end}" for end in ("", "_dot") for name in names[: ARM.start])
    sensors = numbers["sensors"]
    blocks = (
        plant,
        delay(_of("true", base), _of("state", base), sensors["imu"]["latency_ticks"]),
        *_joints(flight, names[ARM], sensors["joints"]["latency_ticks"]),
        *_hand(flight, names, posture),
        _laws(flight, names, hover, posture, gains or {}, wrench),
        delay((*RATES, THRUST), _of("arrived", (*RATES, THRUST)), late_setpoints),
        _autopilot(flight, hover, wrench),
    )
    return Stack(blocks, described.control_period, names)


def _of(stage: str, names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{stage}.{name}" for name in names)


def _joints(flight: DirectFlight, names: Sequence[str], latency: int) -> tuple[LinearBlock, ...]:
    """Return latency and observer of the joints: true.<joint> → state.<joint>, with rates."""
    estimator, n = flight.control.estimator.estimator, len(names)
    both = (*names, *(f"{name}_dot" for name in names))
    period, ticks = flight.plant.period, 0

    def step(given: np.ndarray) -> np.ndarray:
        nonlocal ticks
        ticks += 1
        estimator.joints(ticks * period, given[:n], given[n:])
        state = estimator.update()
        return np.concatenate([state[CHI, ARM], state[CHI_DOT, ARM]])

    step(np.zeros(2 * n))
    block = linearise(step, [estimator], _of("read", both), _of("state", both))
    return delay(_of("true", both), _of("read", both), latency), block


def hand_signals(names: Sequence[str]) -> tuple[str, ...]:
    """Return the corrections of the joints and their rates; names: of the joints."""
    return _of("hand", (*names, *(f"{name}_dot" for name in names)))


def _hand(
    flight: DirectFlight, names: Sequence[str], posture: Sequence[float]
) -> tuple[LinearBlock, ...]:
    """Return the stabilisation of the hand: base → correction of the arm's reference; or none."""
    hand = flight.control.hand
    if not hand.steers:
        return ()
    base, joints, size = names[: ARM.start], names[ARM], len(names)
    reference, state = np.zeros((3, size)), np.zeros((3, size))
    reference[CHI, ARM] = posture

    def step(given: np.ndarray) -> np.ndarray:
        state[CHI, : ARM.start] = given
        return (hand.update(state, reference, True, False) - reference)[:CHI_DDOT, ARM].ravel()

    for _ in range(round(2.0 * FADE / flight.plant.period)):
        step(np.zeros(len(base)))
    return (linearise(step, [hand], _of("state", base), hand_signals(joints)),)


def _laws(
    flight: DirectFlight,
    names: Sequence[str],
    hover: Hover,
    posture: Sequence[float],
    gains: Gains,
    wrench: bool,
) -> LinearBlock:
    """Return the three laws, or that of the whole body, and the map: state → setpoint, effort."""
    control, signals, size = flight.control, flight.control.signals, len(names)
    signals.flying, weight, hand = True, hover.weight, control.hand
    signals.reference[CHI, ARM] = posture
    period = round(flight.plant.period * 1e9)
    corrections = hand_signals(names[ARM]) if hand.steers else ()
    steered, setpoints = hand.arrays.reference, control.bridge.map
    stages = (control_whole_body,) if control.whole else LAWS

    def step(given: np.ndarray) -> np.ndarray:
        given, correction = given[: 2 * size], given[2 * size :]
        signals.stamp += period
        signals.state[CHI], signals.state[CHI_DOT] = given[:size], given[size:]
        steered[:] = signals.reference
        if len(correction):
            steered[:CHI_DDOT, ARM] += correction.reshape(2, -1)
        for stage in stages:
            stage(control)
        tau_q = signals.tau_q
        now = signals.state[CHI, ATTITUDE], signals.state[CHI_DOT, ATTITUDE]
        sent, thrust = setpoints.map(signals.tau_p, tau_q, *now)
        if wrench:
            sent = setpoints.normalised(tau_q, thrust)
        return np.concatenate([sent, [thrust], signals.tau_alpha])

    still = np.zeros(2 * size + len(corrections))
    still[:size][ARM] = posture
    step(still)
    # thrust of the operating point: the payload's weight as desired acceleration
    signals.reference[CHI_DDOT, Z] = (weight - signals.tau_p[2]) * (
        1.0 / flight.control.position.controller.parameters.inertia[2]
    )
    for subsystem, values in gains.items():
        control.laws[subsystem].controller.law.adaptation[: len(values)] = values
    step(still)
    laws = [stage.controller for stage in control.laws.values()]
    inputs = (*_of("state", (*names, *(f"{name}_dot" for name in names))), *corrections)
    outputs = (*RATES, THRUST, *_of("effort", names[ARM]))
    return linearise(step, laws, inputs, outputs, still)


def _autopilot(flight: DirectFlight, hover: Hover, wrench: bool) -> LinearBlock:
    """Return the autopilot's rate loop: arrived setpoint, gyro → motor commands."""
    autopilot, period = flight.autopilot.autopilot, flight.plant.period
    rates, thrust = flight.control.bridge.map.map(
        np.array([0.0, 0.0, hover.weight]), np.zeros(3), np.zeros(3), np.zeros(3)
    )
    setpoint = np.zeros(4)

    def step(given: np.ndarray) -> np.ndarray:
        setpoint[:3], setpoint[3] = swap_body(given[:3]), given[3]
        if wrench:
            return autopilot.allocate(setpoint[:3], setpoint[3]).copy()
        return autopilot.rate_loop(swap_body(given[3 + 1 :]), period, setpoint).copy()

    at = np.array([*np.zeros(3), thrust, *np.zeros(3)])
    inputs = (*_of("arrived", (*RATES, THRUST)), "true.roll_dot", "true.pitch_dot", "true.yaw_dot")
    outputs = tuple(f"motor.{i + 1}" for i in range(len(autopilot.motors)))
    step(at)
    return linearise(step, [autopilot], inputs, outputs, at)

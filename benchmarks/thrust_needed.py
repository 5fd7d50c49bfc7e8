"""How much of its full thrust the hardest rotor needs to stand still, in the draws of a campaign.

    .venv/bin/python benchmarks/thrust_needed.py                          # robustness, laboratory
    .venv/bin/python benchmarks/thrust_needed.py --ranges laboratory --flights 1000

No flight is flown. The plant of every draw is put at three moments of pick_and_place: hover after
take-off, with the payload above its stand, with the payload at the drop point. Rotors balance
weight, standing force and torque and the mean wind's drag; battery and fade are of the moment.
Above 1 no controller holds height, attitude and heading together. Prints the share of draws above
each limit, and with --list the value of every draw.
"""

from __future__ import annotations

import argparse

import mujoco
import numpy as np

from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.settings import configuration
from uam_control.vehicle import load_description
from uam_lab.experiments.campaign.variations import Draws, ranges
from uam_lab.experiments.trials.trial import Trial
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.vehicle import BASE, PAYLOAD

# mission time [s], angles of the arm [deg], with the payload
MOMENTS = ((5.0, (0.0, 90.0), False), (40.0, (45.0, 45.0), True), (70.0, (-45.0, -45.0), True))
LIMITS = (0.9, 0.95, 1.0, 1.03, 1.05)
SLOW = ("battery_sag", "thrust_fade")


def share_needed(trial: Trial) -> float:
    """Return thrust / full thrust of the hardest rotor at the hardest of MOMENTS."""
    vehicle = Vehicle.of(trial.profile.vehicle).changed(trial.vehicle_changes)
    plant = MujocoPlant(vehicle, trial.payload_mass, trial.seed)
    described, rotors, effects = vehicle.description, plant.rotors, plant.effects.acting
    largest, now = 0.0, 0.0
    for time, angles, carried in MOMENTS:
        needed = hover_thrust(plant, np.radians(angles), carried)
        rotors.thrust[:] = needed
        while now < time:
            plant.effects.bench.lift[:] = 1.0
            for name in SLOW:
                if name in effects:
                    effects[name].steps["tick"](effects[name].arrays)
            now += described.control_period
        full = rotors.efficiency * rotors.constants[1] * plant.effects.bench.lift
        largest = max(largest, float(np.max(needed / full)))
    return largest


def hover_thrust(plant: MujocoPlant, angles: np.ndarray, carried: bool) -> np.ndarray:
    """Return the thrust (rotors,) [N] that holds the vehicle still and level at the arm's `angles`
    (n,) [rad]; carried: with the payload at the tool."""
    model, data, described = plant.model, plant.data, plant.vehicle.description
    mujoco.mj_resetData(model, data)
    base, first = model.body(BASE), model.joint(described.joint_names[0])
    data.joint(BASE).qpos[:] = 0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0
    data.qpos[first.qposadr[0] : first.qposadr[0] + len(angles)] = angles
    mujoco.mj_forward(model, data)
    parts = np.flatnonzero(model.body_rootid == model.body_rootid[base.id])
    mass = model.body_mass[parts]
    if carried:
        face = data.site(described.end_effector).xpos
        mass = np.append(mass, model.body_mass[model.body(PAYLOAD).id])
        places = np.vstack([data.xipos[parts], face])
    else:
        places = data.xipos[parts]
    standing, torque = np.zeros(3), np.zeros(3)
    if (load := plant.effects.acting.get("standing_load")) is not None:
        standing, torque = load.arrays[2]
    air = plant.vehicle.numbers["air"]
    pushed = standing + np.multiply(air["drag"], air["wind"])
    middle, weight = mass @ places / mass.sum(), mass.sum() * described.gravity
    up = weight - standing[2]
    across = pushed * [1.0, 1.0, 0.0]  # a small tilt balances it with the weight
    moment = torque + np.cross(data.xipos[base.id] - middle, across)
    moment += np.cross(middle - data.xpos[base.id], [0.0, 0.0, -weight])
    at = plant.effects.bench.positions
    reaction = [model.actuator(name).gear[5] for name in described.rotor_names]
    balance = np.vstack([np.ones(len(at)), at[:, 1], -at[:, 0], reaction])
    upward = np.hypot(up, np.hypot(*across[:2]))
    return np.linalg.lstsq(balance, np.array([upward, *-moment]), rcond=None)[0]


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ranges", default="robustness")
    parser.add_argument("--plant-preset", nargs="*", default=["laboratory"])
    parser.add_argument("--flights", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", action="store_true")
    given = parser.parse_args()
    vehicle = load_description("s500_arm")
    profile, allowed = (
        default_profile("modular", vehicle),
        ranges(configuration.named("campaign", given.ranges)),
    )
    effects = presets.read(given.plant_preset, ())
    draws = Draws(profile, given.flights, given.seed, allowed, "pick_and_place", effects)
    load_scenario(draws.scenario, vehicle)
    found = np.array([share_needed(draws[number]) for number in range(given.flights)])
    if given.list:
        print(*(f"{number} {share:.3f}" for number, share in enumerate(found)), sep="\n")
    shares = ", ".join(f"above {limit:g}: {np.mean(found > limit):.1%}" for limit in LIMITS)
    print(f"{given.ranges}, {given.flights} draws: median {np.median(found):.2f}, {shares}")


if __name__ == "__main__":
    main()

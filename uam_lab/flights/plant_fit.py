"""Whether the effects of a plant fit vehicle and profile: their sizes are those of another one."""

import math
from collections.abc import Iterator

import numpy as np

from uam_control.control.output_limits import WORLD
from uam_control.coordinates import CHI, YAW
from uam_control.mission.motion.trajectory import reference_rows
from uam_control.mission.scenarios.scenario import Scenario
from uam_control.profiles.profile import Profile
from uam_sim_bridge.plant.effects.load_effects import StandingLoad
from uam_sim_bridge.plant.effects.presets import Effects
from uam_sim_bridge.plant.effects.rotor_effects import BatterySag, RotorMismatch

HALF = 0.5  # of the torque, of the battery, that a vehicle needs
TURNED = math.radians(90.0)  # of the heading, beyond which what turns with it is another force
STEP = 0.1  # [s] between two headings
BATTERY = 5.0 / 2.2  # [A h/kg] of the S-500, for which config/plant/laboratory.yaml is


def notes(profile: Profile, effects: Effects, scenario: Scenario) -> tuple[str, ...]:
    """Return notes about a standing torque that leaves the attitude law less than half of its own,
    a standing force that turns with a heading with which theta_hat does not turn, and a battery of
    less than half of the S-500's capacity per mass."""
    return (
        *_torque(profile, effects),
        *_force(profile, effects, scenario),
        *_battery(profile, effects),
    )


def _torque(profile: Profile, effects: Effects) -> Iterator[str]:
    name = StandingLoad.NAME
    most = getattr(profile.sets["attitude_controller"], "torque_max", ())
    yaw = effects.get(RotorMismatch.NAME, {}).get("yaw", 1.0)
    for axis, torque, own in zip(
        "xyz", effects.get(name, {}).get("torque", ()), most, strict=False
    ):
        left = own * yaw if axis == "z" else own
        if abs(torque) > HALF * left:
            yield (
                f"{name}: {abs(torque):.3g} N m about {axis}, of {left:.3g} N m that "
                f"{profile.vehicle.name} makes there; --effect {name}:torque=X/Y/Z"
            )


def _force(profile: Profile, effects: Effects, scenario: Scenario) -> Iterator[str]:
    load = effects.get(StandingLoad.NAME, {})
    frame = getattr(profile.sets["position_controller"], "bias_frame", "")
    if not any(load.get("force", ())) or not load.get("turning") or frame != WORLD:
        return
    begun, trajectory = scenario.from_origin()
    times, joints = np.arange(0.0, begun.landing.end, STEP), len(profile.vehicle.joints)
    if np.ptp(reference_rows(trajectory, times, joints)[CHI, :, YAW]) > TURNED:
        profiles = " ".join(f"--profile {name}" for name in (*profile.name.split("+"), "indoors"))
        yield (
            f"{StandingLoad.NAME}: its force turns with the heading, which this path turns, but "
            f"theta_hat of the profile does not: {profiles}"
        )


def _battery(profile: Profile, effects: Effects) -> Iterator[str]:
    name, mass = BatterySag.NAME, profile.vehicle.mass
    if name not in effects:
        return
    capacity, usual = effects[name]["capacity"], BATTERY * mass
    if capacity < HALF * usual:
        resistance = effects[name]["resistance"] * capacity / usual
        yield (
            f"{name}: {capacity:g} A h are few for {mass:g} kg: the thrust falls far, and heading "
            f"or path is lost; as for the S-500: --effect {name}:capacity={usual:.3g},"
            f"resistance={resistance:.2g}"
        )

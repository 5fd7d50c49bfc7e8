"""Whether the effects of a plant fit the vehicle: their sizes are those of another one."""

from __future__ import annotations

from collections.abc import Iterator

from uam_control.profiles.profile import Profile
from uam_sim_bridge.plant.effects.battery_sag import BatterySag
from uam_sim_bridge.plant.effects.mismatches import RotorMismatch
from uam_sim_bridge.plant.effects.presets import Effects
from uam_sim_bridge.plant.effects.standing_load import StandingLoad

HALF = 0.5  # of the torque, of the battery, that a vehicle needs
BATTERY = 5.0 / 2.2  # [A h/kg] of the S-500, for which config/plant/laboratory.yaml is


def notes(profile: Profile, effects: Effects) -> tuple[str, ...]:
    """Return notes about a standing torque that leaves the attitude law less than half of its own,
    and about a battery of less than half of the S-500's capacity per mass."""
    return (*_torque(profile, effects), *_battery(profile, effects))


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


def _battery(profile: Profile, effects: Effects) -> Iterator[str]:
    name, mass = BatterySag.NAME, profile.vehicle.mass
    if name not in effects:
        return
    capacity, usual = effects[name]["capacity"], BATTERY * mass
    if capacity < HALF * usual:
        resistance = effects[name]["resistance"] * capacity / usual
        yield (
            f"{name}: {capacity:g} A h are few for {mass:g} kg: the thrust falls far; as for the "
            f"S-500: --effect {name}:capacity={usual:.3g},resistance={resistance:.2g}"
        )

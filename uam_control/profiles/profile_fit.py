"""Whether a profile fits its vehicle: numbers that are probably of another one."""

from uam_control.profiles.profile import Profile

TOLERATED = 0.3  # relative error of an inertia that the adaptive laws take (docs/your_vehicle.md)


def misfits(profile: Profile) -> tuple[str, ...]:
    """Return lines about the position controller's inertia and thrust, and about the estimator's
    bandwidths beside the rate of the vehicle's motion capture; none if they fit."""
    vehicle, parameters = profile.vehicle, profile.sets["position_controller"]
    found = []
    for axis, inertia in zip("xyz", getattr(parameters, "inertia", ()), strict=False):
        if abs(inertia - vehicle.mass) > TOLERATED * vehicle.mass:
            found.append(
                f"inertia {inertia:g} kg along {axis}, the vehicle has {vehicle.mass:g} kg"
            )
            break
    if parameters.thrust_max > vehicle.full_thrust:
        full = f"the rotors' full thrust is {vehicle.full_thrust:.3g} N"
        found.append(f"thrust_max {parameters.thrust_max:g} N, {full}")
    interval = 1.0 / vehicle.numbers["sensors"]["mocap"]["rate"]
    wide = profile.sets["state_estimator"].capped(interval)
    text = f"profile {profile.name} does not fit {vehicle.name}"
    return tuple(
        f"{text}: {node} {'; '.join(lines)}"
        for node, lines in (("position_controller has", found), ("state_estimator:", wide))
        if lines
    )

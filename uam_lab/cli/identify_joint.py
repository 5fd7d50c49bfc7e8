"""`uam identify-joint`: identify torque constant and friction of one joint.

Move one joint of the arm, the others held, and fit torque constant, Coulomb and viscous friction.

examples:
  uam identify-joint alpha_2 --config my_lab.yaml --load 0.2
  uam identify-joint alpha_1 --config my_lab.yaml --centre 30 --amplitude 30
  uam identify-joint alpha_2 --duration 40 --yes      without the question

Propellers off, vehicle level and fixed, hands away: the joint moves. A load at the magnet makes
the torque constant visible (its weight is the reference). Results in --out: identification.yaml
(to paste into the lab file), friction.png, samples.csv. Ctrl-C ends it with torque off.
Exit status: 0 identified, 1 aborted or not identifiable, 2 wrong use or no device.
"""

import argparse
import math
import time
from collections.abc import Callable

import numpy as np

from uam_control.arm.chain import carrying
from uam_control.arm.kinematics import gravity_torque
from uam_control.settings.atomic import replacing, write_text
from uam_control.vehicle import chain_of
from uam_lab.cli.arm import described, driver_of
from uam_lab.cli.command import Command, number
from uam_lab.records.results.terminal import say
from uam_sim_bridge.devices.dynamixel.chain import ArmError
from uam_sim_bridge.devices.dynamixel.excitation import ExcitationParameters
from uam_sim_bridge.devices.dynamixel.friction_fit import FrictionFit

DONE, NOT_DONE = 0, 1
MOTION = "amplitude_deg duration effort_max"  # options
GRID = 181  # angles at which the weight is computed
CLOCK = time.monotonic  # [s]


def add(command: Command) -> None:
    command.option("joint", "JOINT", "name of the joint, as alpha_2")
    command.arm_hardware()
    command.described(ExcitationParameters, MOTION, effort_max="NM")
    angle = number("angle", "deg", -360.0, 360.0)
    text = "centre of the motion (default: nearest to the present angle)"
    command.option("--centre", "DEG", text, type=angle)
    mass = number("mass", "kg", 0.0, 5.0)
    command.option("--load", "KG", "mass that hangs at the magnet", 0.0, type=mass)
    command.switch("--yes", "do not ask before the joint moves")
    command.out("identify-<joint>")


def run(options: argparse.Namespace) -> int:
    from uam_lab.records.results.result_folder import make_folder
    from uam_lab.report.figures.hand_figures import draw_friction
    from uam_sim_bridge.devices.dynamixel.excitation import Aborted, centre_of, excite
    from uam_sim_bridge.devices.dynamixel.friction_fit import FitError, fit_friction

    driver = driver_of(options, CLOCK)
    names = driver.chain.joint_names
    if options.joint not in names:
        raise ArmError(f"no joint '{options.joint}'; there are: {', '.join(names)}")
    if driver.in_position_mode:
        raise ArmError("the vehicle's servos.mode is position; identification needs current")
    joint = names.index(options.joint)
    p = ExcitationParameters.from_mapping({name: vars(options)[name] for name in MOTION.split()})
    try:
        driver.start()
        for remark in driver.remarks:
            say(remark)
        angles = np.array(driver.start_angles)
        given = angles[joint] if options.centre is None else math.radians(options.centre)
        centre = centre_of(driver, joint, given, p)
        if not options.yes and not confirmed(options.joint, angles[joint], centre, p):
            say("not confirmed: nothing moved")
            return NOT_DONE
        weight = weight_of(options, angles, joint)
        out = make_folder(options.out, "identify", options.joint)  # before the joint moves
        record = excite(driver, joint, centre, weight, p, pacing(driver.rate))
        loads = np.array([weight(one)[joint] for one in record.position[:, joint]])
        fit = fit_friction(record, joint, loads)
    except (Aborted, FitError) as error:
        say(f"not identified: {error}")
        return NOT_DONE
    finally:
        driver.stop()
    text = pasted(options.joint, driver.chain.arm[joint].torque_scale, fit)
    write_text(out / "identification.yaml", text)
    columns = (record.times, record.position[:, joint], record.effort[:, joint], loads)
    head = "time_s,angle_rad,effort_nm,weight_nm"
    with replacing(out / "samples.csv") as temporary:
        np.savetxt(temporary, np.column_stack(columns), "%.6f", ",", header=head, comments="")
    draw_friction(out / "friction.png", options.joint, fit)
    say(text, end="")
    say(f"residual {fit.residual:.4f} N m, inertia {fit.inertia:.4f} kg m^2")
    if not fit.scale_known:
        say("torque_scale is unchanged: the weight is too small to show it; hang a --load")
    say(f"results  {out}")
    return DONE


def confirmed(joint: str, angle: float, centre: float, p: ExcitationParameters) -> bool:
    """Ask whether the joint may move; angle, centre [rad]."""
    total = p.duration + 2.0 * p.approach
    say(
        f"{joint} moves from {math.degrees(angle):.0f} deg to {math.degrees(centre):.0f} deg and "
        f"then {p.amplitude_deg:g} deg to either side, {total:.0f} s in all; at most "
        f"{p.effort_max:g} N m.\nPropellers off, vehicle level and fixed, hands away. "
    )
    try:
        return input("Type yes to begin: ").strip().lower() == "yes"
    except EOFError:
        return False


def weight_of(
    options: argparse.Namespace, angles: np.ndarray, joint: int
) -> Callable[[float], np.ndarray]:
    """Return the function: angle [rad] of the joint → holding torques (n,) [N m].

    angles (n,) [rad]: of the others.
    """
    vehicle, _ = described(options)
    chain, limits = carrying(chain_of(vehicle), options.load), vehicle.joints[joint]
    grid = np.linspace(limits.low, limits.high, GRID)
    poses = np.repeat(angles[None], GRID, axis=0)
    poses[:, joint] = grid
    torques, force = np.empty_like(poses), (0.0, 0.0, vehicle.gravity)
    for pose, held in zip(poses, torques, strict=True):
        gravity_torque(chain, pose, force, held)

    def weight(angle: float) -> np.ndarray:
        return np.array([np.interp(angle, grid, column) for column in torques.T])

    return weight


def pacing(rate: float) -> Callable[[], float]:
    """Return a function that waits for the next cycle of `rate` [Hz] and returns the time [s]."""
    due = time.monotonic()

    def pace() -> float:
        nonlocal due
        due = max(due + 1.0 / rate, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
        return time.monotonic()

    return pace


def pasted(joint: str, scale: float, fit: FrictionFit) -> str:
    """Return the result as YAML for the lab file; scale: of the file until now."""
    known = f"+- {scale * fit.scale_deviation:.3f}" if fit.scale_known else "not identified"
    coulomb, viscous = max(0.0, fit.coulomb), max(0.0, fit.viscous)
    return (
        f"    - joint: {joint}   # identified {time.strftime('%Y-%m-%d')}\n"
        f"      torque_scale: {scale * fit.scale:.4f}   # {known}\n"
        f"      coulomb: {coulomb:.4f}        # +- {fit.coulomb_deviation:.4f} N m\n"
        f"      viscous: {viscous:.4f}        # +- {fit.viscous_deviation:.4f} N m s/rad\n"
    )

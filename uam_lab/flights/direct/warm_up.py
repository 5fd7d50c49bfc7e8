"""Compiles the control path before a flight, so that no node compiles during the flight.

The compiled functions are kept on disk beside their sources (see uam_control.maths.compiled). When
all of them are there and up to date, nothing is compiled.
"""

import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from uam_control.arm.hand import hands
from uam_control.arm.kinematics import ORIGIN, gravity_torque, mass_matrix
from uam_control.coordinates import ALPHA
from uam_control.grasp.sight import RunningMean, hand_and_levers
from uam_control.laws import catalogue
from uam_control.laws.catalogue import LAWS
from uam_control.maths.compiled import on_disk
from uam_control.mission import Feasibility, load_scenario
from uam_control.mission.motion.trajectory import empty_motion
from uam_control.mission.scenarios.scenario import standing
from uam_control.profiles.profile import default_profile
from uam_control.setpoints.targets import VisionPose
from uam_control.stages.bridge_stage import sending
from uam_control.stages.control_tick import ControlTick
from uam_control.stages.law_stages import arm_step, attitude_step, position_step
from uam_control.stages.tick_stamps import Timing
from uam_control.vehicle import chain_of
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.autopilot import companion
from uam_sim_bridge.autopilot.joined import STEPS
from uam_sim_bridge.faults.schedule import read_schedule
from uam_sim_bridge.mavlink.protocol.setpoint_messages import vision_message
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets

PACKAGES = ("uam_control", "uam_sim_bridge", "uam_lab")
FURTHER = [law for law in LAWS if law != catalogue.DEFAULT]
BESIDE = "--beside"  # as an option of this module as a program
TICKS = 1000  # 4 s: the vehicle is armed and in the air by then, and every function has run
LATE_POSES = "mocap_latency@0+1:delay=0.05"  # the estimator corrects earlier predictions, too


def compiled_functions() -> Iterator:
    """Yield every function under `jit` in the imported modules; none without numba."""
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] in PACKAGES:
            for value in vars(module).values():
                if hasattr(value, "py_func") and value.py_func.__module__ == name:
                    yield value


def is_cold() -> bool:
    """Return whether a function of the control path is not compiled from its present source."""
    law = LAWS[catalogue.DEFAULT].step
    made = (make(law) for make in (position_step, attitude_step, arm_step))
    return not all(map(on_disk, (*compiled_functions(), *made, sending(STEPS))))


def prepare(say: Callable[[str], None] = lambda text: None) -> None:
    """Compile the control path unless it is compiled; say: called before that takes its time."""
    if is_cold():
        say("compiling the control path (once)")
        # A flight is made from the plant on. A process on another core does this, with the further
        # laws. Here the default law's control is made before its plant, so both rarely compile the
        # same function.
        command = [sys.executable, "-m", "uam_lab.flights.direct.warm_up", BESIDE]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as beside:
            try:
                _control()
                warm_up([catalogue.DEFAULT])
            except BaseException:
                beside.terminate()
                raise
        if beside.returncode:
            warm_up(FURTHER)


def warm_up(laws: Iterable[str]) -> None:
    """Fly a few seconds in the direct engine with each law: it runs every function of the nodes,
    with the default law the compiled ticks, too."""
    effects = presets.read([presets.LABORATORY, presets.ODOMETRY])
    vehicle = Vehicle.load().changed({"effects": effects})
    for law in laws:
        flight = fly(law, vehicle)
        if law == catalogue.DEFAULT:
            flight.advance(TICKS, TICKS)
    _others()


def fly(law: str, vehicle: Vehicle) -> DirectFlight:
    """Return a flight of TICKS ticks: they have run every function of the nodes."""
    scenario = load_scenario("hover")
    faults = read_schedule([LATE_POSES], scenario, seed=1)
    flight = DirectFlight(scenario, default_profile(law), vehicle, 0.0, seed=1, faults=faults)
    for _ in range(TICKS):
        flight.tick()
    return flight


def _control() -> None:
    """Make the control of a flight with the default law."""
    vehicle, sets = Vehicle.load().description, default_profile(catalogue.DEFAULT).sets
    ControlTick.parts(load_scenario("hover"), sets, Timing(), vehicle)


def _others() -> None:
    curve = load_scenario("circle")
    limits = default_profile(catalogue.DEFAULT).sets["mission"]
    vehicle = Vehicle.load().description
    check = Feasibility(vehicle, limits, 0.0)
    for scenario in (load_scenario("hover"), curve):
        check.excesses(scenario)
    curve.trajectory(standing(curve.arm_start)).write(4.0, empty_motion(len(curve.arm_start)))
    mean = RunningMean()  # of the grasp, which a flight without a payload does not check
    for stamp in (0.0, 0.004):
        mean.add(stamp, np.zeros(3))
    joints = len(curve.arm_start)
    chain, still = chain_of(vehicle), np.zeros(joints)
    hand_and_levers(chain, np.zeros(ALPHA + joints))
    hands(chain, np.zeros((1, ALPHA + joints)), np.zeros(1))
    gravity_torque(chain, still, ORIGIN, still.copy())  # of the bring-up
    mass_matrix(chain, still, np.zeros((joints, joints)))  # of nobody here: for users
    vision_message(VisionPose(0.0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), 0.0, 0.0))
    companion.warm_up()  # the stand-in's descent, which a flight without failures does not call


if __name__ == "__main__":
    if BESIDE in sys.argv:
        warm_up(FURTHER)
    else:
        prepare(print)

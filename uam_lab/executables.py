"""The executables of the nodes: Ctrl-C is obeyed while their modules load.

An import that is interrupted fails in other words, or goes on: numba loses the interrupt.
"""

import importlib
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

MODULES = {
    "position_controller": "uam_control.nodes.position_controller",
    "attitude_controller": "uam_control.nodes.attitude_controller",
    "arm_controller": "uam_control.nodes.arm_controller",
    "whole_body_controller": "uam_control.nodes.whole_body_controller",
    "state_estimator": "uam_control.nodes.state_estimator",
    "mission": "uam_control.nodes.mission",
    "teleop": "uam_control.nodes.teleop",
    "flight_controller": "uam_sim_bridge.nodes.flight_controller",
    "mujoco_sim": "uam_sim_bridge.nodes.mujoco_sim",
    "mavlink_bridge": "uam_sim_bridge.nodes.mavlink_bridge",
    "recorder": "uam_lab.records.recorder",
    "scene": "uam_lab.cockpit.scene",
    "cockpit": "uam_lab.cockpit.cockpit_node",
    "checklist": "uam_lab.preflight.checklist_node",
    "arm_driver": "uam_sim_bridge.nodes.arm_driver",
    "autopilot": "uam_sim_bridge.autopilot.server",
    "px4_sitl": "uam_sim_bridge.px4.sitl",
    "px4_hitl": "uam_sim_bridge.px4.hitl",
    "hitl_router": "uam_sim_bridge.mavlink.hil.router",
    "mocap_driver": "uam_sim_bridge.nodes.mocap_driver",
    "magnet_driver": "uam_sim_bridge.nodes.magnet_driver",
    "laboratory": "uam_sim_bridge.nodes.laboratory",
}
COMPILING = "_raw_object_cache_notify"  # of llvmlite: LLVM calls it, an exception in it is lost
AGAIN = 0.02  # [s]


def main() -> int:
    """Run the executable by whose name this program was called; return its exit status."""
    obeyed = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if obeyed:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    module = importlib.import_module(MODULES[Path(sys.argv[0]).name])
    if obeyed:
        signal.signal(signal.SIGINT, interrupt)
    return module.main()


def interrupt(_: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt; within a function that would lose it, a moment later."""
    while frame is not None and frame.f_code.co_name != COMPILING:
        frame = frame.f_back
    if frame is None:
        raise KeyboardInterrupt
    here = threading.main_thread().ident
    threading.Timer(AGAIN, signal.pthread_kill, (here, signal.SIGINT)).start()

"""Faults of processes: killed, stopped, slow, without discovery. They require the ROS engine."""

from typing import ClassVar

from uam_control.settings.parameter_set import choice, number
from uam_sim_bridge.faults.fault import PROCESS, Fault

NODES = (
    "state_estimator",
    "mission",
    "position_controller",
    "attitude_controller",
    "arm_controller",
    "mavlink_bridge",
    "autopilot",
    "scene",
    "recorder",
)
NODE = "affected process"


class ProcessFault(Fault):
    """A fault of one process; its times are wall times."""

    PLACE: ClassVar[str] = PROCESS

    node: str = choice("arm_controller", NODE, NODES)


class NodeKill(ProcessFault):
    """A process is killed (SIGKILL); only a controller is started again."""


class NodeStall(ProcessFault):
    """A process is stopped (SIGSTOP) and continues when the fault ends."""


class NodeSlow(ProcessFault):
    """A process is stopped for a fraction of each cycle, as on a busy computer."""

    stopped: float = number(0.5, "fraction of the cycle in which it is stopped", "1", 0.0, 0.95)
    cycle: float = number(0.02, "length of a cycle", "s", 0.005, 1.0)


class DiscoveryLoss(ProcessFault):
    """A process neither sends nor receives DDS discovery data; its connections last until its
    lease at the other processes expires."""

    node: str = choice("arm_controller", NODE, tuple(one for one in NODES if one != "autopilot"))

"""Faults of processes: killed, stopped, slow, without discovery. They require the ROS engine."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class ProcessFault(Fault):
    """A fault of one process; its times are wall times."""

    PLACE: ClassVar[str] = PROCESS

    node: str = choice("arm_controller", NODE, NODES)


@dataclass(frozen=True)
class NodeKill(ProcessFault):
    NAME: ClassVar[str] = "node_kill"
    ABOUT: ClassVar[str] = "a process is killed (SIGKILL); only a controller is started again"


@dataclass(frozen=True)
class NodeStall(ProcessFault):
    NAME: ClassVar[str] = "node_stall"
    ABOUT: ClassVar[str] = "a process is stopped (SIGSTOP) and continues when the fault ends"


@dataclass(frozen=True)
class DiscoveryLoss(ProcessFault):
    NAME: ClassVar[str] = "discovery_loss"
    ABOUT: ClassVar[str] = (
        "a process neither sends nor receives DDS discovery data; "
        "its connections last until its lease at the other processes expires"
    )

    node: str = choice("arm_controller", NODE, tuple(one for one in NODES if one != "autopilot"))


@dataclass(frozen=True)
class NodeSlow(ProcessFault):
    NAME: ClassVar[str] = "node_slow"
    ABOUT: ClassVar[str] = (
        "a process is stopped for a fraction of each cycle, as on a busy computer"
    )

    stopped: float = number(0.5, "fraction of the cycle in which it is stopped", "1", 0.0, 0.95)
    cycle: float = number(0.02, "length of a cycle", "s", 0.005, 1.0)


FAULTS = (NodeKill, NodeStall, NodeSlow, DiscoveryLoss)

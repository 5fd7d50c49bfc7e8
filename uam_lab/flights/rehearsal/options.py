"""What a rehearsal has beside the lab file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.px4.px4_installation import Px4Installation


@dataclass(frozen=True)
class RehearsalOptions:
    """seed: of all noise; payload_mass [kg]; vehicle_changes: of the plant, effects
    too; faults: of cables.

    arm_start (n,) [rad]: joint angles on the ground, () for stowed; checklist: whether the lists
    are required and a person does them; px4: a build without lockstep
    that flies in the stand-in's place, px4_params: NAME=VALUE for it.
    """

    seed: int = 1
    payload_mass: float = 0.0
    vehicle_changes: Mapping[str, object] = field(default_factory=dict)
    faults: Schedule = Schedule()
    arm_start: tuple[float, ...] = ()
    checklist: bool = True
    px4: Px4Installation | None = None
    px4_params: tuple[str, ...] = ()

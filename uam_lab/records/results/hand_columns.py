"""Where the end effector is and should be, tick by tick, from the recorded states.

A hand that hangs on a hinge is where the recorded hinge has it. The reference is the hand of the
mission's reference: of its base in the attitude that its acceleration needs, and of its arm.
"""

import numpy as np

from uam_control.arm.hand import HEADING, hands
from uam_control.coordinates import CHI
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.motion.flatness import Flyer, flattened

GROUPS = TRUTH, REFERENCE, ERROR = "end_effector", "end_effector_reference", "end_effector_error"
COORDINATES = {"x": "m", "y": "m", "z": "m", "heading": "rad", "elevation": "rad"}


def declared() -> dict[str, str]:
    """Return the columns: name → unit."""
    return {f"{group}.{name}": unit for group in GROUPS for name, unit in COORDINATES.items()}


def computed(
    flyer: Flyer, truth: np.ndarray, reference: np.ndarray, swing: np.ndarray
) -> np.ndarray:
    """Return the columns (ticks, 15) in the order of `declared`.

    truth: chi (ticks, 6 + n); reference (3, ticks, 6 + n): its attitude is replaced; swing
    (ticks,) [rad]: of the hinge that a hand hangs on, NaN: unknown.
    """
    flattened(reference, flyer)
    found, wanted = hands(flyer.chain, truth, swing), hands(flyer.chain, reference[CHI])
    error = found - wanted
    error[:, HEADING:] = wrap_angle(error[:, HEADING:])
    return np.concatenate([found, wanted, error], axis=1)

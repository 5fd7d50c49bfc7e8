"""Stage: stabilisation of the hand. state + reference → reference of the arm law."""

import numpy as np

from uam_control.arm.chain import Chain, ChainParameters
from uam_control.arm.hand import freedom
from uam_control.control.hand_steering import (
    IDLE,
    INSIDE,
    REAL,
    TEXTS,
    WHOLE,
    HandArrays,
    HandParameters,
    steer,
)
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import record
from uam_control.stages.step import DONE
from uam_control.vehicle import VehicleDescription, VehicleError, chain_of


class HandStage:
    """Corrects the reference of the arm law; `arrays`: what compiled functions use."""

    def __init__(
        self,
        parameters: HandParameters,
        period: float,
        joints: int,
        vehicle: VehicleDescription | None,
    ) -> None:
        """period [s] of a tick; joints: of the arm; vehicle: without one there is no hand."""
        chain, ranges = _arm(vehicle)
        numbers = record(WHOLE, REAL)
        numbers["has_hand"], numbers["period"], numbers["why"] = chain.has_hand, period, IDLE
        numbers["freedom"] = freedom(chain) if chain.has_hand else 0
        size = 6 + joints
        self.arrays = HandArrays(
            *(chain, ranges, np.zeros((2, joints)), np.zeros(size), np.zeros((6, joints))),
            *(np.zeros((3, size)), numbers),
        )
        rows = self.arrays.reference
        self._steer = bound(steer, self.arrays, rows, rows, True, True)
        self.configure(parameters)

    @property
    def steers(self) -> bool:
        """Whether the arm stabilises a hand in flight."""
        numbers = self.arrays.numbers[0]
        return bool(numbers.has_hand != 0 and numbers.hand_bandwidth > 0.0)

    def configure(self, parameters: HandParameters) -> None:
        """Use `parameters` (validated) from the next tick on."""
        for name in HandParameters.specs():
            self.arrays.numbers[name] = getattr(parameters, name)

    def update(
        self, state: np.ndarray, reference: np.ndarray, flying: bool, saturated: bool
    ) -> np.ndarray:
        """Return the reference (3, 6 + n) of the arm law; see `steer`."""
        self._steer(state, reference, flying, saturated)
        return self.arrays.reference

    @property
    def fades(self) -> str:
        """Why the correction fades out, "" while it acts, or if there is none."""
        one = self.arrays.numbers[0]
        return TEXTS[int(one["why"])] if one["has_hand"] and one["hand_bandwidth"] else ""


def _arm(vehicle: VehicleDescription | None) -> tuple[Chain, np.ndarray]:
    """Return the arm and the ranges of its joints (2, n) [rad], a margin inside."""
    try:
        chain = chain_of(vehicle) if vehicle is not None else ChainParameters().chain()
    except VehicleError:
        chain = ChainParameters().chain()
    joints = () if vehicle is None else vehicle.joints
    ranges = np.array([[one.low + INSIDE, one.high - INSIDE] for one in joints]).reshape(-1, 2)
    return chain, np.ascontiguousarray(ranges.T)


@borrowing
def hand_step(a: tuple) -> int:
    """Do what `HandStage.update` does, in flight."""
    s, h, law = a
    steer(h, s.state, s.reference, True, law[0].saturated != 0)
    return DONE

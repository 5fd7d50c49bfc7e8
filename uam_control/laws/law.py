"""What every law is to its controller: parameters, adapted gains, one compiled step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uam_control.laws.law_parameters import LawParameters


class Law:
    """One subsystem's law and its adapted gains.

    `names` are those of the gains that it publishes, the first of `adaptation`; what follows them
    is the law's own memory. `frozen`: the adapted gains stay as they are (parameter `adapt`).
    """

    step: Callable  # compiled; see `update` for what it is given

    def __init__(self, parameters: LawParameters, names: tuple[str, ...], memory: int = 0) -> None:
        self.names = names
        self._tau = np.zeros(len(parameters.inertia))
        self.adaptation = np.zeros(len(names) + memory)
        self.set_parameters(parameters)
        self.reset()

    def set_parameters(self, parameters: LawParameters) -> None:
        """Fly `parameters` (validated) from the next tick on; the adapted gains are kept."""
        self.parameters = parameters
        self.frozen = not parameters.adapt
        self._record = parameters.record()

    def reset(self) -> None:
        """Start afresh: adapted gains at their initial values, nothing remembered."""
        self.adaptation[:] = 0.0
        self.reset_adaptation()

    def reset_adaptation(self) -> None:
        """Put the adapted gains back to their initial values; filters and time go on."""
        raise NotImplementedError

    def update(
        self,
        e: np.ndarray,
        e_dot: np.ndarray,
        acceleration_d: np.ndarray,
        norms: np.ndarray,
        saturated: bool,
        dt: float,
    ) -> np.ndarray:
        """Return tau_j (n,) and advance the adapted gains by dt [s].

        e, e_dot, acceleration_d: (n,), the subsystem's tracking error, its rate and chi_j_d_ddot.
        norms (3,): ||xi||, ||chi_ddot||, ||chi_dot|| of the whole vehicle.
        saturated: the actuator was at its limit in the last tick.
        The returned array is reused by the next call.
        """
        type(self).step(
            self._record,
            e,
            e_dot,
            acceleration_d,
            norms,
            saturated,
            self.frozen,
            dt,
            self.adaptation,
            self._tau,
        )
        return self._tau

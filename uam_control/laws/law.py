"""What every law is to its controller: parameters, adapted gains, one compiled step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uam_control.laws.law_parameters import LawParameters


@dataclass(frozen=True)
class GainGroup:
    """Published gains that share a row of the figure of the adaptation.

    label: of the row; "" for gains that have no row. names: of the gains, hence of the recorded
    columns. symbol: of several gains, to which the last character of a name is the index. Both in
    matplotlib's mathtext. signed: drawn on a linear scale instead of a logarithmic one.
    """

    label: str
    names: tuple[str, ...]
    symbol: str = ""
    signed: bool = False


class Law:
    """One subsystem's law and its adapted gains.

    A law is a subclass with these attributes and `gain_groups`, listed in `catalogue.LAWS`:

    | attribute | is |
    |---|---|
    | `kind` | its parameters; the default of their `law` is the name of the law |
    | `label` | its name in tables and figures |
    | `profile` | the profile in config/profiles that it flies with; "" see `default_profile` |
    | `memory` | count of values in `adaptation` after the published gains |
    | `step` | the compiled function of one tick; `update` says what its arguments are |

    `names` are those of the published gains, the first values of `adaptation`. `frozen`: the
    adapted gains stay as they are (parameter `adapt`).
    """

    kind: type[LawParameters]
    label: str
    profile: str = ""
    memory: int = 0
    step: Callable

    def __init__(self, parameters: LawParameters) -> None:
        axes = len(parameters.inertia)
        self.names = self.gain_names(axes)
        self._tau = np.zeros(axes)
        self.adaptation = np.zeros(len(self.names) + self.memory)
        self.set_parameters(parameters)
        self.reset()

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        """Return the published gains of a subsystem with `axes` axes, in order of `adaptation`."""
        raise NotImplementedError

    @classmethod
    def gain_names(cls, axes: int) -> tuple[str, ...]:
        """Return the names of the published gains of a subsystem with `axes` axes."""
        return tuple(name for group in cls.gain_groups(axes) for name in group.names)

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

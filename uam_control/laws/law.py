"""Base class of the laws: parameters, adapted gains, one compiled step per tick."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from uam_control.laws.law_parameters import LawParameters
from uam_control.maths.compiled import prepared


@dataclass(frozen=True)
class GainGroup:
    """Published gains that share a row in the figure of the adaptation."""

    label: str  # of the row, matplotlib mathtext; "" for gains without a row
    names: tuple[str, ...]  # of the gains and of the recorded columns
    symbol: str = ""  # mathtext for a row of several; the end of a name is its index
    signed: bool = False  # drawn on a linear scale instead of a logarithmic one

    @classmethod
    def of_axes(cls, label: str, name: str, symbol: str, axes: int) -> Self:
        """Return one signed gain per axis: name1, name2, ..."""
        return cls(label, tuple(f"{name}{i}" for i in range(1, axes + 1)), symbol, signed=True)


class LawInputs(NamedTuple):
    """Inputs of a law at one tick: those of `Law.update`, and whether the gains are frozen."""

    e: np.ndarray
    e_dot: np.ndarray
    acceleration_d: np.ndarray
    norms: np.ndarray
    saturated: bool
    frozen: bool
    dt: float


class LawArrays(NamedTuple):
    """What `Law.step` gets at every tick: the record of its parameters, its adapted gains, tau."""

    record: np.ndarray
    adaptation: np.ndarray
    tau: np.ndarray


class Law:
    """The law of one subsystem and its adapted gains.

    A law is a subclass with the attributes below and `gain_groups`, listed in `catalogue.LAWS`.
    `names`: of the published gains, the first values of `adaptation`, a float64 array (len(names) +
    memory + per_axis n,).
    """

    kind: type[LawParameters]  # the default of their `law` is the name of the law
    label: str  # its name in tables and figures
    profile: str = ""  # its profile in config/profiles; "": see `default_profile`
    memory: int = 0  # values in `adaptation` after the published gains, in all
    per_axis: int = 0  # such values per axis
    whole: bool = False  # in flight `control.whole_body` computes all three subsystems
    step: Callable  # the compiled function of one tick: step(record, inputs, adaptation, tau)

    def __init__(self, parameters: LawParameters) -> None:
        axes, self.parameters = len(parameters.inertia), parameters
        self.names = self.gain_names(axes)
        self._tau, self._no_bias = np.zeros(axes), np.zeros(axes)
        self.adaptation = np.zeros(len(self.names) + self.memory + self.per_axis * axes)
        self.set_parameters(parameters)
        self.reset()

    @classmethod
    def gain_groups(cls, axes: int) -> tuple[GainGroup, ...]:
        """Return the published gains of a subsystem with `axes` axes, ordered as `adaptation`."""
        raise NotImplementedError

    @classmethod
    def gain_names(cls, axes: int) -> tuple[str, ...]:
        """Return the names of the published gains of a subsystem with `axes` axes."""
        return tuple(name for group in cls.gain_groups(axes) for name in group.names)

    def set_parameters(self, parameters: LawParameters) -> None:
        """Use `parameters` (validated) from the next tick on; the adapted gains stay."""
        self.parameters = parameters
        self.frozen = not parameters.adapt  # the adapted gains do not change
        self.arrays = LawArrays(parameters.record(), self.adaptation, self._tau)
        own = self._tau
        inputs = LawInputs(own, own, own, np.zeros(3), False, False, 0.0)
        self._step = prepared(type(self).step, self.arrays.record, inputs, self.adaptation, own)

    @property
    def bias(self) -> np.ndarray:
        """Adapted constant part of dtau (n,) [m/s^2 or rad/s^2], writable; zero without one.

        It is what the vehicle carries, so it outlasts `reset` and `reset_adaptation`.
        """
        return self._no_bias

    def reset(self) -> None:
        """Set the adapted gains to their initial values, and filters and time to zero."""
        carried = self.bias.copy()
        self.adaptation[:] = 0.0
        self.bias[:] = carried
        self.reset_adaptation()

    def reset_adaptation(self) -> None:
        """Set the adapted gains to their initial values; filters and time continue.

        By default all begins anew, at zero.
        """
        self.adaptation[:] = 0.0

    def update(
        self,
        e: np.ndarray,
        e_dot: np.ndarray,
        acceleration_d: np.ndarray,
        norms: np.ndarray,
        saturated: bool,
        dt: float,
    ) -> np.ndarray:
        """Return tau_j (n,) [N or N m] and advance the adapted gains by dt [s].

        e, e_dot, acceleration_d: (n,), the subsystem's tracking error [m or rad], its rate and
        chi_j_d_ddot; world frame (ENU) for the position, body frame (FLU) for the attitude, per
        joint for the arm. norms (3,): ||xi||, ||chi_ddot||, ||chi_dot|| of the whole vehicle.
        saturated: the actuator was at its limit in the last tick.
        The next call reuses the returned array.
        """
        inputs = LawInputs(e, e_dot, acceleration_d, norms, saturated, self.frozen, dt)
        self._step(self.arrays.record, inputs, self.adaptation, self._tau)
        return self._tau

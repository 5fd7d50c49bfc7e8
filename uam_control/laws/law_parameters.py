"""Parameters that all laws have, and those of the modular adaptive law (the paper's Table I)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from uam_control.laws import lyapunov
from uam_control.laws.errors import ERROR_RATE_FORMS
from uam_control.settings.parameter_set import (
    HUGE,
    TINY,
    Bound,
    ParameterError,
    ParameterSet,
    Switch,
    choice,
    number,
    switch,
    vector,
)

SAFEGUARD = "safeguard"  # how the description of a parameter begins that the law does not have


@dataclass(frozen=True)
class LawParameters(ParameterSet):
    """What every law has; vectors have one entry per axis (3, or one per joint of the arm)."""

    law: str = choice("", "the law that flies, fixed once the node runs", (), fixed=True)
    adapt: bool = switch(
        True, "false: the adapted gains stay, those of a whole flight at their initial values"
    )
    error_rate_form: str = choice(
        "lee", "lee: Omega - R^T R_d Omega_d; printed: q_dot - R_d^T R q_d_dot", ERROR_RATE_FORMS
    )

    @property
    def safeguards(self) -> list[str]:
        """Names of the safeguards that are on; no law's source has any (docs/law.md)."""
        return [
            name
            for name, spec in self.specs().items()
            if isinstance(spec, Bound | Switch)
            and spec.description.startswith(SAFEGUARD)
            and np.any(getattr(self, name))
        ]

    def record(self) -> np.ndarray:
        """Return the one-element structured array that the compiled law reads."""
        raise NotImplementedError


def structured(values: dict[str, Any]) -> np.ndarray:
    """Return `values`, numbers and vectors, as a one-element structured float64 array.

    Its element is a np.record: compiled or not, its fields are attributes.
    """
    fields = [(name, np.float64, np.shape(value)) for name, value in values.items()]
    record = np.zeros(1, np.dtype((np.record, fields)))
    for name, value in values.items():
        record[name][0] = value
    return record


def ceiling(values: tuple) -> np.ndarray:
    """Return the largest values allowed, where 0 means that there is none."""
    return np.where(np.array(values) > 0.0, values, np.inf)


@dataclass(frozen=True)
class ModularParameters(LawParameters):
    """One entry per axis, or K0..K3."""

    law: str = choice("modular", "the law that flies, fixed", ("modular",), fixed=True)
    inertia: tuple = vector((), "Mbar, its diagonal", "kg or kg m^2", TINY, 1e3)
    lambda_1: tuple = vector((), "lambda_1, gain on e", "1/s^2", TINY, HUGE)
    lambda_2: tuple = vector((), "lambda_2, gain on e_dot", "1/s", TINY, HUGE)
    lambda_form: str = choice(
        "theory",
        "theory: Lambda = [lambda_1 lambda_2]; table: lambda_table (e_dot + 2 e)",
        ("theory", "table"),
    )
    lambda_table: tuple = vector(
        (), "Lambda as printed, used by lambda_form: table", "1/s", TINY, HUGE
    )
    q_position: tuple = vector((), "Q, its half on e", "1", TINY, HUGE)
    q_velocity: tuple = vector((), "Q, its half on e_dot", "1", TINY, HUGE)
    k_initial: tuple = vector((), "K0..K3 at the start", "1", TINY, HUGE, 4)
    zeta_initial: float = number(0.01, "zeta at the start", "1", TINY, HUGE)
    nu: tuple = vector((), "leakage nu_0..nu_3 of K0..K3", "1/s", 1e-6, 1e4, 4)
    epsilon: float = number(1e-4, "epsilon, what drives zeta", "1/s", TINY, HUGE)
    varpi: float = number(0.1, "varpi, boundary layer of ||r||", "1", TINY, HUGE)
    k_ceiling: tuple = vector(
        (0.0, 0.0, 0.0, 0.0), "safeguard: largest K0..K3, 0 = off", "1", 0.0, HUGE, 4
    )
    freeze_when_saturated: bool = switch(
        False, "safeguard: K0..K3 do not grow while the actuator saturates"
    )
    acceleration_limit: float = number(
        0.0, "safeguard: largest ||chi_ddot|| used, 0 = off", "m/s^2 or rad/s^2", 0.0, HUGE
    )
    acceleration_cutoff: float = number(
        0.0, "safeguard: low-pass on ||chi_ddot||, 0 = off", "Hz", 0.0, 125.0
    )

    def check_together(self) -> None:
        """Also refuse gains whose Lyapunov matrix P is not positive definite as computed."""
        super().check_together()
        p11, p12, p22 = self.lyapunov_matrix()
        if not np.all((1.0 - 1e-12) * p11 * p22 > p12 * p12):
            raise ParameterError(
                "lambda_1, lambda_2, q_position, q_velocity: together they give a matrix P that "
                "is not positive definite in double precision"
            )

    def lyapunov_matrix(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return p11, p12, p22, each (n,), see `lyapunov.solve`."""
        given = (self.lambda_1, self.lambda_2, self.q_position, self.q_velocity)
        return lyapunov.solve(*map(np.array, given))

    def record(self) -> np.ndarray:
        """Return the one-element structured array that the compiled law reads."""
        p11, p12, p22 = self.lyapunov_matrix()
        theory = self.lambda_form == "theory"
        table = np.array(self.lambda_table)
        return structured(
            {
                "inertia": self.inertia,
                "gain_e": self.lambda_1 if theory else 2.0 * table,
                "gain_e_dot": self.lambda_2 if theory else table,
                "p11": p11,
                "p12": p12,
                "p22": p22,
                "nu": self.nu,
                "k_ceiling": ceiling(self.k_ceiling),
                "epsilon": self.epsilon,
                "varpi": self.varpi,
                "acceleration_limit": self.acceleration_limit or np.inf,
                "acceleration_cutoff": self.acceleration_cutoff,
                "freeze_when_saturated": float(self.freeze_when_saturated),
            }
        )

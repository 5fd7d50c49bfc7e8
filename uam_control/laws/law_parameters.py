"""Parameters that all laws have, and the structured array that a compiled law reads."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from uam_control.laws.errors import ERROR_RATE_FORMS
from uam_control.settings.parameter_set import Bound, ParameterSet, Switch, choice, switch

SAFEGUARD = "safeguard"  # first word of the description of a parameter that the source lacks


@dataclass(frozen=True)
class LawParameters(ParameterSet):
    """Parameters of every law; vectors have one entry per axis (3, or one per joint of the arm)."""

    law: str = choice("", "the law that flies, fixed once the node runs", (), fixed=True)
    adapt: bool = switch(
        True, "false: the adapted gains stay, those of a whole flight at their initial values"
    )
    error_rate_form: str = choice(
        "lee", "lee: Omega - R^T R_d Omega_d; printed: q_dot - R_d^T R q_d_dot", ERROR_RATE_FORMS
    )

    def linear(self) -> Self:
        """Return these parameters for a linear model, in which the gains are given and stay."""
        return replace(self, adapt=False)

    @property
    def safeguards(self) -> list[str]:
        """Names of the safeguards that are on; the printed laws have none (docs/law.md)."""
        return [
            name
            for name, spec in self.specs().items()
            if isinstance(spec, Bound | Switch)
            and spec.description.startswith(SAFEGUARD)
            and np.any(getattr(self, name))
        ]

    def record(self) -> np.ndarray:
        """Return the structured array (1,) that the compiled law reads.

        It has each number, vector and switch of the law by its name, and the values of `derived`.
        The limits around the law are not in it: those of the arm have another length for each
        vehicle, and the law would be compiled anew for each.
        """
        laws = [one for one in type(self).__mro__ if issubclass(one, LawParameters)]
        own = {name for law in laws for name in vars(law).get("__annotations__", ())}
        specs = self.specs().items()
        numeric = [name for name, of in specs if name in own and isinstance(of, Bound | Switch)]
        return structured({name: getattr(self, name) for name in numeric} | self.derived())

    def derived(self) -> dict[str, Any]:
        """Return values for `record` that the law computes from its parameters, by name."""
        return {}


def structured(values: dict[str, Any]) -> np.ndarray:
    """Return `values`, numbers and vectors, as a structured float64 array (1,).

    Its element is a np.record: its fields are attributes in compiled and in plain Python code.
    """
    fields = [(name, np.float64, np.shape(value)) for name, value in values.items()]
    record = np.zeros(1, np.dtype((np.record, fields)))
    for name, value in values.items():
        record[name][0] = value
    return record


def ceiling(values: tuple) -> np.ndarray:
    """Return the largest allowed values (n,), with infinity in place of 0 (no limit)."""
    return np.where(np.array(values) > 0.0, values, np.inf)

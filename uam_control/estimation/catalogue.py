"""All estimators by name. A new one is a file in this folder and an entry in `ESTIMATORS`."""

from collections.abc import Mapping
from typing import Any

from uam_control.estimation.base import Estimator
from uam_control.estimation.estimator import StateEstimator
from uam_control.settings.parameter_set import ParameterError, by_name

ESTIMATORS: dict[str, type[Estimator]] = by_name("estimator", (StateEstimator,))
DEFAULT = StateEstimator.kind.estimator


def estimator(name: str) -> type[Estimator]:
    """Return the class of the estimator `name`; raises ParameterError for an unknown name."""
    if name not in ESTIMATORS:
        raise ParameterError(f"estimator: '{name}' is not one of {', '.join(ESTIMATORS)}")
    return ESTIMATORS[name]


def chosen(values: Mapping[str, Any]) -> type[Estimator]:
    """Return the class that raw parameters choose; raises ParameterError for an unknown name."""
    return estimator(values.get("estimator", DEFAULT))


def own_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return raw parameters without those that the default estimator has and the chosen one not.

    So a profile may choose another estimator on top of a whole profile. Raises ParameterError.
    """
    usual, own = StateEstimator.kind.specs(), chosen(values).kind.specs()
    return {name: value for name, value in values.items() if name in own or name not in usual}

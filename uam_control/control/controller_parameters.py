"""The parameter set of a controller: the parameters of its law and of its limits."""

from __future__ import annotations

from dataclasses import make_dataclass
from functools import cache
from typing import Any

from uam_control.laws.law_parameters import LawParameters
from uam_control.settings.parameter_set import ParameterSet


@cache
def controller_parameters(
    law: type[LawParameters], limits: type[ParameterSet]
) -> type[LawParameters]:
    """Return the class with the parameters of `law` and `limits`; one class for each pair."""

    def reduce(self: LawParameters) -> tuple[Any, ...]:
        return _restored, (law, limits, vars(self))

    # pickle finds a class by its name in a module; this class has none there
    name = f"{law.__name__}And{limits.__name__}"
    return make_dataclass(
        name, [], bases=(law, limits), namespace={"__reduce__": reduce}, frozen=True
    )


def _restored(
    law: type[LawParameters], limits: type[ParameterSet], values: dict[str, Any]
) -> LawParameters:
    return controller_parameters(law, limits)(**values)

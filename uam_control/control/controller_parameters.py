"""The parameter set of a controller: those of its law and those of its limits in one."""

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
    """Return the set with the parameters of `law` and of `limits`; of the same two, the same."""

    def reduce(self: LawParameters) -> tuple[Any, ...]:
        return _restored, (law, limits, vars(self))

    # pickle looks up a class by its name, which a class made here does not have
    name = f"{law.__name__}And{limits.__name__}"
    return make_dataclass(
        name, [], bases=(law, limits), namespace={"__reduce__": reduce}, frozen=True
    )


def _restored(
    law: type[LawParameters], limits: type[ParameterSet], values: dict[str, Any]
) -> LawParameters:
    return controller_parameters(law, limits)(**values)

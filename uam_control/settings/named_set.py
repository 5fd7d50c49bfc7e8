"""A parameter set of a kind that users choose by name, as faults and effects of the plant."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

from uam_control.settings.parameter_set import ParameterSet


class NamedSet(ParameterSet):
    """Base of sets with a name. A subclass is a frozen dataclass without a decorator.

    NAME: that of the class, `MotorLoss` is `motor_loss`; ABOUT: its docstring in one line, as the
    description for the user.
    """

    NAME: ClassVar[str]
    ABOUT: ClassVar[str]

    def __init_subclass__(cls) -> None:
        cls.NAME = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
        about = " ".join((cls.__doc__ or "").split()).rstrip(".")
        cls.ABOUT = about[:1].lower() + about[1:]
        dataclass(frozen=True)(cls)

"""Every law by name: what flies it, what people call it, and the profile it flies with."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.laws.asmc1 import Asmc1Law
from uam_control.laws.asmc2 import ADAPTATION as ASMC2
from uam_control.laws.asmc2 import Asmc2Law
from uam_control.laws.law import Law
from uam_control.laws.modular import ADAPTATION as MODULAR
from uam_control.laws.modular import ModularLaw
from uam_control.settings.parameter_set import ParameterError


@dataclass(frozen=True)
class Entry:
    """A law, its label in tables and figures, its default profile in config/profiles."""

    law: type[Law]
    label: str
    profile: str


LAWS = {
    "modular": Entry(ModularLaw, "modular", "s500"),
    "asmc1": Entry(Asmc1Law, "ASMC-1 (reconstructed)", "asmc1"),
    "asmc2": Entry(Asmc2Law, "ASMC-2 (reconstructed)", "asmc2"),
}
DEFAULT = "modular"

# Names of all published gains, of whatever law and number of axes.
ADAPTATION = (*MODULAR, "D1", "D2", "D3", "s_norm", *ASMC2)


def entry(law: str) -> Entry:
    """Return the law of that name; raises ParameterError."""
    if law not in tuple(LAWS):
        raise ParameterError(f"law: '{law}' is not one of {', '.join(LAWS)}")
    return LAWS[law]


def label(law: str) -> str:
    """Return what people call a law; a name that is none stays what it is."""
    return LAWS[law].label if law in LAWS else law

"""All laws by name. A new law is a file in this folder and an entry in `LAWS`."""

from uam_control.laws.asmc1 import Asmc1Law
from uam_control.laws.asmc2 import Asmc2Law
from uam_control.laws.geometric import GeometricL1Law, GeometricLaw
from uam_control.laws.indi import IndiLaw
from uam_control.laws.law import GainGroup, Law
from uam_control.laws.modular import ModularLaw
from uam_control.laws.whole_body import WholeBodyL1Law
from uam_control.settings.parameter_set import ParameterError, by_name

LAWS: dict[str, type[Law]] = by_name(
    "law",
    (
        ModularLaw,
        Asmc1Law,
        Asmc2Law,
        GeometricLaw,
        GeometricL1Law,
        IndiLaw,
        WholeBodyL1Law,
    ),
)
DEFAULT = ModularLaw.kind.law


def law(name: str) -> type[Law]:
    """Return the class of the law `name`; raises ParameterError for an unknown name."""
    if name not in tuple(LAWS):
        raise ParameterError(f"law: '{name}' is not one of {', '.join(LAWS)}")
    return LAWS[name]


def label(name: str) -> str:
    """Return the label of a law in tables and figures; its name, if the law is unknown or another
    one has the label, too."""
    labels = [law.label for law in LAWS.values()]
    return LAWS[name].label if name in LAWS and labels.count(LAWS[name].label) == 1 else name


def gain_names(axes: int) -> tuple[str, ...]:
    """Return the names of the gains in `gain_groups`."""
    return tuple(name for group in gain_groups(axes) for name in group.names)


def gain_groups(axes: int) -> tuple[GainGroup, ...]:
    """Return the published gains of every law for a subsystem of up to `axes` axes."""
    return tuple(group for law in LAWS.values() for group in law.gain_groups(axes))

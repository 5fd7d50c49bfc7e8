"""Presets of the plant: which effects act, and their numbers; files of config/plant.

The form of a file: docs/plant.md. A parameter that it does not give is that of laboratory.yaml, or
of odometry.yaml.
"""

from collections.abc import Mapping, Sequence
from functools import cache

from uam_control.settings import configuration, yaml_file
from uam_control.settings.parameter_set import ParameterError
from uam_sim_bridge.plant.effects.catalogue import EFFECTS
from uam_sim_bridge.plant.plant import PlantError

CALM, LABORATORY, ODOMETRY = "calm", "laboratory", "odometry"
Effects = dict[str, dict[str, float | list[float]]]  # name → parameters


def read(presets: Sequence[str] = (), switches: Sequence[str] = ()) -> Effects:
    """Return the effects of presets (names or files) and switches; later ones override.

    switches: NAME, NAME=off or NAME:parameter=value,...; a list's values have / between them.
    Raises PlantError, ConfigurationError in one line.
    """
    effects: Effects = {}
    for preset in presets:
        file = configuration.named("plant", preset, suffixes=(".yaml",))
        document = yaml_file.read(file, PlantError) or {}
        if not isinstance(document, Mapping):
            raise PlantError(f"{file}: 'effect: {{parameter: value}}' lines expected")
        for name, value in document.items():
            _change(effects, name, value, f"{file}: ")
    for text in switches:
        name, value = _switch(text)
        _change(effects, name, value, "--effect ")
    return effects


def added(changes: Mapping[str, object], effects: Effects) -> dict[str, object]:
    """Return dotted changes of a vehicle's numbers with the effects added, if there are any."""
    return {**changes, "effects": effects} if effects else dict(changes)


def _switch(text: str) -> tuple[str, object]:
    name, colon, rest = text.partition(":")
    if colon:
        found: dict[str, float | list[float]] = {}
        for key, _, value in (part.partition("=") for part in rest.split(",")):
            if key in found:
                raise PlantError(f"--effect {text}: {key} is given twice")
            numbers = [_number(text, one) for one in value.split("/")]
            found[key] = numbers if len(numbers) > 1 else numbers[0]
        return name, found
    name, _, state = text.partition("=")
    if state not in ("", "on", "off"):
        raise PlantError(f"--effect {text}: NAME, NAME=off or NAME:parameter=value,... expected")
    return name, state != "off"


def _number(text: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise PlantError(f"--effect {text}: {value!r} is not a number") from None


def _change(effects: Effects, name: object, value: object, where: str) -> None:
    if not isinstance(name, str) or name not in EFFECTS:
        raise PlantError(f"{where}unknown effect '{name}'; there are: {', '.join(EFFECTS)}")
    if value is False:
        effects.pop(name, None)
        return
    if value is not True and not isinstance(value, Mapping):
        raise PlantError(f"{where}{name}: {value!r}: on, off or parameters expected")
    usual = effects.get(name) or usual_numbers().get(name, {})
    given = {} if value is True else dict(value)
    for parameter, number in given.items():  # a number is a list of one
        if isinstance(getattr(EFFECTS[name], parameter, None), tuple):
            given[parameter] = number if isinstance(number, list) else [number]
    try:
        checked = EFFECTS[name].from_mapping(usual | given)
    except ParameterError as error:
        raise PlantError(f"{where}{name}: {error}") from None
    effects[name] = checked.to_mapping()


@cache
def usual_numbers() -> Effects:
    """Return the numbers of each effect, by name: of the laboratory, which has no odometry."""
    odometry = yaml_file.read(configuration.path(f"plant/{ODOMETRY}.yaml"), PlantError)
    return laboratory() | odometry | laboratory()


@cache
def laboratory() -> Effects:
    """Return the content of config/plant/laboratory.yaml."""
    return yaml_file.read(configuration.path(f"plant/{LABORATORY}.yaml"), PlantError)


def _shown(value: float | list[float]) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:g}"


def table() -> str:
    """Return the effects in Markdown: of docs/plant.md."""
    rows = [f"| `{name}` | {EFFECTS[name].ABOUT} |" for name in usual_numbers()]
    return "\n".join(["| effect | does |", "|---|---|", *rows]) + "\n"


def listing() -> str:
    """Return effects, parameters with usual numbers, and sources as text for a terminal."""
    lines = []
    for name, values in usual_numbers().items():
        lines.append(f"{name}: {EFFECTS[name].ABOUT}")
        lines += [
            f"    {parameter}: {spec.description} "
            f"({_shown(values.get(parameter, []))} {spec.unit}".removesuffix(" 1")
            + ")"
            for parameter, spec in EFFECTS[name].ranges()
        ]
        lines.append(f"    source: {EFFECTS[name].SOURCE}")
    return "\n".join(lines)


if __name__ == "__main__":
    print(listing())

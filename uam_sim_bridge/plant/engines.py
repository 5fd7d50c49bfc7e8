"""The physics engines by name. A new engine is a class and a line here, or "module:Class"."""

import inspect
import pkgutil

from uam_sim_bridge.plant.plant import Plant

PLANTS = {"mujoco": "uam_sim_bridge.plant.mujoco_plant:MujocoPlant"}
DEFAULT_PLANT = "mujoco"


class PlantError(ValueError):
    """The plant does not exist; the text is one line."""


def plant_class(name: str) -> type[Plant]:
    """Return the class of a name in PLANTS or of "module:Class"; raises PlantError."""
    place = PLANTS.get(name, name)
    if ":" not in place:
        raise PlantError(
            f"unknown plant '{name}'; there are: {', '.join(PLANTS)}, or a class as module:Class"
        )
    try:
        found = pkgutil.resolve_name(place)
    except (ImportError, AttributeError, ValueError) as error:
        raise PlantError(f"plant '{name}': {error}") from None
    if not (inspect.isclass(found) and issubclass(found, Plant)) or inspect.isabstract(found):
        raise PlantError(f"plant '{name}': a class that is a Plant with all its methods expected")
    return found

"""A key that nothing reads is refused in every kind of file, at every level, with its place."""

import re
from copy import deepcopy

import pytest
import yaml

from uam_control.mission import load_scenario
from uam_control.settings import configuration, yaml_file
from uam_control.vehicle import load_description
from uam_lab.experiments.campaign import variations
from uam_lab.experiments.faults import matrix as fault_matrix
from uam_lab.experiments.tuning.space import load_space
from uam_lab.flights.vehicle.lab_file import load_lab
from uam_sim_bridge.devices.mocap.calibration import load as load_calibration
from uam_sim_bridge.plant.effects import presets

# kind → a file of config/, its reader, places whose keys are names of the user's or are read later
KINDS = {
    "vehicle": ("vehicle/s500_arm", lambda file: load_description(file), "profiles"),
    "timed scenario": ("scenarios/circle_payload", lambda file: load_scenario(str(file)), ""),
    "curve": ("scenarios/arm_sweep", lambda file: load_scenario(str(file)), ""),
    "route": ("scenarios/waypoints", lambda file: load_scenario(str(file)), ""),
    "plant": ("plant/laboratory", lambda file: presets.read([str(file)]), ""),
    "lab": ("lab/s500_lab", lambda file: load_lab(str(file)), "nodes"),
    "ranges": ("campaign/delays", variations.ranges, ""),
    "matrix": (
        "campaign/processes",
        lambda file: fault_matrix.read(file, "ros"),
        "moments",
    ),
    "space": ("tuning/late_links", lambda file: load_space(str(file)), r"flights.*\.vehicle"),
    "calibration": ("mocap/motive_z_up", lambda file: load_calibration(str(file)), ""),
}


def mappings(values, place=""):
    """Yield each mapping in the content of a file, with its place as an error names it."""
    if isinstance(values, dict):
        yield place, values
    for key, value in values.items() if isinstance(values, dict) else enumerate(values):
        if isinstance(value, dict | list):
            here = f"[{key}]" if isinstance(values, list) else f".{key}" if place else str(key)
            yield from mappings(value, place + here)


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_key_is_refused(tmp_path, kind):
    name, read, free = KINDS[kind]
    whole = configuration.path(f"{name}.yaml")
    if kind == "vehicle":
        for other in ("s500_arm.xml", "parts"):
            (tmp_path / other).symlink_to(whole.parent / other)
    document, file = yaml_file.read(whole, ValueError), tmp_path / whole.name
    file.write_text(yaml.safe_dump(document))
    read(file)
    places = [
        place for place, _ in mappings(document) if not place or not re.fullmatch(free, place)
    ]
    for place in (one for one in places if not one or not re.fullmatch(free, one)):
        wrong = deepcopy(document)
        dict(mappings(wrong))[place]["dargg"] = 1.0
        file.write_text(yaml.safe_dump(wrong))
        with pytest.raises(ValueError, match="dargg") as refused:
            read(file)
        said = str(refused.value)
        assert str(file) in said and "unknown" in said and "\n" not in said
        assert place in said or kind == "matrix", place  # it names the fault

"""What trials depend on, and what a worker needs that does not share the file system.

A resumed campaign must have the same inputs, by name.

Names in config/ need nothing: every worker has the same configuration (`workers.identity`). A
scenario that is a file travels as it was read, a model of the user as its files.
"""

import hashlib
import inspect
import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

from uam_control.laws.catalogue import LAWS
from uam_control.mission import Scenario, load_scenario
from uam_control.profiles.profile import Profile
from uam_control.settings import configuration
from uam_control.vehicle import VehicleDescription
from uam_lab.experiments.workers.identity import identity

FOLDERS = ("meshdir", "texturedir", "assetdir")  # of MuJoCo's element `compiler`


@dataclass(frozen=True)
class Carried:
    """Content of the files of a flight."""

    scenario: Scenario | None  # as it was read, None for one of config/
    model: str  # the MJCF file, relative to config/, or to `files` if there are any
    files: dict[str, bytes] = field(default_factory=dict)  # content by relative path
    gripper: str = ""  # its MJCF file, as model, "" without


def carried(scenario: str, profile: Profile) -> Carried:
    """Return what flights of this scenario (name or file) with this profile need."""
    (model, *gripper), files = _models(profile.vehicle.models)
    own = Path(scenario).suffix.lower() in (".yaml", ".csv")
    read = _scenario(scenario, profile.vehicle.source) if own else None
    return Carried(read, model, files, *gripper)


def arrived(given: Carried, profile: Profile) -> Profile:
    """Return the profile with the vehicle's model where it is in this process."""
    folder = _unpacked(tuple(sorted(given.files.items()))) if given.files else configuration.root()
    vehicle: VehicleDescription = replace(profile.vehicle, model=folder / given.model)
    if given.gripper:
        there = vehicle.numbers["gripper"] | {"model": str(folder / given.gripper)}
        vehicle = replace(vehicle, numbers=vehicle.numbers | {"gripper": there})
    return replace(profile, vehicle=vehicle)


@lru_cache(maxsize=64)
def _scenario(scenario: str, vehicle: str) -> Scenario:
    from uam_control.vehicle import load_description

    return load_scenario(scenario, load_description(vehicle))


@lru_cache(maxsize=64)
def _models(given: tuple[Path, ...]) -> tuple[tuple[str, ...], dict[str, bytes]]:
    models, content = [model.resolve() for model in given], {}
    top = configuration.root().resolve()
    if not all(model.is_relative_to(top) for model in models):
        files = {file for model in models for file in files_of_model(model)}
        top = Path(os.path.commonpath([file.parent for file in files]))
        content = {file.relative_to(top).as_posix(): file.read_bytes() for file in files}
    return tuple(model.relative_to(top).as_posix() for model in models), content


def files_of_model(model: Path) -> list[Path]:
    """Return an MJCF file and all files that it names, as absolute paths."""
    model = model.resolve()
    return sorted(set(_of_model(model, model.parent, ())))


def _of_model(file: Path, folder: Path, further: tuple[str, ...]) -> Iterator[Path]:
    """Yield an MJCF file and the files that it names; MuJoCo looks from the main file's folder."""
    yield file
    elements = list(ElementTree.parse(file).iter())
    named = (one.get(key) for one in elements if one.tag == "compiler" for key in FOLDERS)
    further = (*further, *(name for name in named if name))
    for one in elements:
        names = [value for key, value in one.attrib.items() if key.startswith("file")]
        places = [folder / place / name for name in names for place in ("", *further)]
        for found in filter(Path.is_file, places):
            found = Path(os.path.abspath(found))
            if one.tag in ("include", "model"):
                yield from _of_model(found, folder, further)
            else:
                yield found


_folders: dict[str, tempfile.TemporaryDirectory] = {}  # removed at the end of the process


def _unpacked(files: tuple[tuple[str, bytes], ...]) -> Path:
    """Write the files to a temporary folder, once in this process; return it."""
    name = hashlib.sha256(repr(files).encode()).hexdigest()
    if name not in _folders:
        made = tempfile.TemporaryDirectory(prefix="uam-model-")
        for relative, content in files:
            target = Path(made.name) / relative
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        _folders[name] = made
    return Path(_folders[name].name)


def inputs(
    vehicle: VehicleDescription, scenario: str, further: Mapping[str, object]
) -> dict[str, str]:
    """Return name → digest of all inputs of flights of this vehicle and scenario (name or file).

    further: options, profiles and others, which differ by their repr.
    """
    laws = [Path(inspect.getsourcefile(law)) for law in LAWS.values()]
    named = {
        **further,
        "vehicle": vehicle.numbers,
        "autopilot gains": vehicle.autopilot_gains,
        "model (MJCF and its files)": _content(
            file for model in vehicle.models for file in files_of_model(model)
        ),
        "scenario": _content([configuration.named("scenarios", scenario)]),
        "laws": _content(laws),
        **identity(),
    }
    return {name: _short(value) for name, value in named.items()}


def _short(value: object) -> str:
    if isinstance(value, str) and len(value) <= 16:
        return value
    return hashlib.sha256(repr(value).encode()).hexdigest()[:12]


def _content(files: Iterable[Path]) -> list[tuple[str, str]]:
    return [(file.name, hashlib.sha256(file.read_bytes()).hexdigest()) for file in files]

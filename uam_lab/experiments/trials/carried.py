"""What a trial needs of this machine's files, for a worker that does not share the file system.

Names in config/ need nothing: every worker has the same configuration (`workers.identity`). A
scenario that is a file travels as it was read, a model of the user as its files.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

from uam_control.mission import Scenario, load_scenario
from uam_control.profiles.profile import Profile
from uam_control.settings import configuration
from uam_control.vehicle import VehicleDescription

FOLDERS = ("meshdir", "texturedir", "assetdir")  # of MuJoCo's element `compiler`


@dataclass(frozen=True)
class Carried:
    """scenario: as it was read, None for one of config/. model: the MJCF file, relative to config/,
    or to `files` if there are any; files: content by relative path."""

    scenario: Scenario | None
    model: str
    files: dict[str, bytes] = field(default_factory=dict)


def carried(scenario: str, profile: Profile) -> Carried:
    """Return what flights of this scenario (name or file) with this profile need."""
    model, files = _model(profile.vehicle.model)
    if Path(scenario).suffix.lower() not in (".yaml", ".csv"):
        return Carried(None, model, files)
    return Carried(_scenario(scenario, profile.vehicle.source), model, files)


def arrived(given: Carried, profile: Profile) -> Profile:
    """Return the profile with the vehicle's model where it is in this process."""
    folder = _unpacked(tuple(sorted(given.files.items()))) if given.files else configuration.root()
    vehicle: VehicleDescription = replace(profile.vehicle, model=folder / given.model)
    return replace(profile, vehicle=vehicle)


@lru_cache(maxsize=64)
def _scenario(scenario: str, vehicle: str) -> Scenario:
    from uam_control.vehicle import load_description

    return load_scenario(scenario, load_description(vehicle))


@lru_cache(maxsize=64)
def _model(model: Path) -> tuple[str, dict[str, bytes]]:
    model = model.resolve()
    root = configuration.root().resolve()
    if model.is_relative_to(root):
        return model.relative_to(root).as_posix(), {}
    files = files_of_model(model)
    top = Path(os.path.commonpath([file.parent for file in files]))
    content = {file.relative_to(top).as_posix(): file.read_bytes() for file in files}
    return model.relative_to(top).as_posix(), content


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

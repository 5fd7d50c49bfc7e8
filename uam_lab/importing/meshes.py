"""Meshes of a URDF: found, tried, and named where one is missing; they are shown, nothing else."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

import mujoco
import numpy as np

from uam_lab.importing.source import ImportRefused, XmlElement

READ = (".stl", ".obj", ".msh")  # by MuJoCo
LARGEST_MESH = 100e6  # [bytes]
LARGE = 20.0  # [m] of a vehicle's part: a mesh in mm
SEARCHED = 6  # folders above the file


class Meshes:
    """The meshes of one file. assets: name → content; files: name in the model → file."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.assets: dict[str, bytes] = {}
        self.files: dict[str, Path] = {}
        self.notes: list[str] = []
        self._names: dict[tuple[Path, str], str] = {}  # by file and scale

    def take(self, mesh: XmlElement) -> bool:
        """Find the file of a mesh element and name it as in `assets`; False: it is left out.

        Raises ImportRefused for a mesh that is as large as a house.
        """
        given = mesh.get("filename") or ""
        found = self.found(given)
        if found is None:
            return self._left_out(mesh, given, "is missing")
        if found.suffix.lower() not in READ:
            return self._left_out(mesh, given, f"is not read: {', '.join(READ)} are")
        if found.stat().st_size > LARGEST_MESH:
            return self._left_out(mesh, given, f"is larger than {LARGEST_MESH / 1e6:g} MB")
        scale = mesh.get("scale") or "1 1 1"
        if (found, scale) not in self._names:
            name = f"mesh_{len(self._names)}_{found.stem}"
            self._names[found, scale] = name + found.suffix.lower()
            self.assets[name + found.suffix.lower()] = found.read_bytes()
            self.files[name] = found
        named = self._names[found, scale]
        size = self._size(named, scale)
        if size is None:
            return self._left_out(mesh, given, "is no mesh that MuJoCo reads")
        if size > LARGE:
            where = f"{self.file} line {mesh.sourceline}"
            raise ImportRefused(f"{where}: mesh {given} is {size:.4g} m large: in mm? scale it")
        mesh.set("filename", named)
        return True

    def found(self, given: str) -> Path | None:
        """Return the file that a URDF names, also as package://NAME/x: searched in the folders
        above the URDF, with as much of the path as there is."""
        words = Path(unquote(given.split("://", 1)[-1])).parts
        whole = Path(*words) if words else Path("no name")
        above = list(self.file.absolute().parents)[:SEARCHED]
        tried = [whole, above[0] / whole]
        for begin in range(len(words) - 1):
            tried += [folder / Path(*words[begin:]) for folder in above]
        return next((one for one in tried if one.is_file()), None)

    def _left_out(self, mesh: XmlElement, given: str, why: str) -> bool:
        text = f"mesh {given} {why}: not shown"
        if not any(note.startswith(text) for note in self.notes):
            self.notes.append(f"{text} (line {mesh.sourceline})")
        return False

    def _size(self, name: str, scale: str) -> float | None:
        """Return the largest extent [m] of a mesh; None if MuJoCo does not read it."""
        spec = mujoco.MjSpec()
        try:
            spec.add_mesh(name="one", file=name, scale=np.array(scale.split(), dtype=float))
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="one", contype=0)
            spec.assets = {name: self.assets[name]}
            return float(2.0 * spec.compile().geom_aabb[0, 3:].max())
        except ValueError:
            return None

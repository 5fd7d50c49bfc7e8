"""Draws a vehicle: python -m uam_lab.importing.picture NAME|FILE picture.png

MuJoCo reads MUJOCO_GL at import, so `draw` does it in a process of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from uam_control.settings.atomic import replacing
from uam_lab.report.video import opengl

if TYPE_CHECKING:
    import mujoco

SIZE = (480, 720)  # height, width [pixels]
LIMIT = 60.0  # [s]
AWAY = 2.9  # distance of the camera, per radius of the vehicle: all of it is in the picture
NEAREST = 0.1  # what is nearer is not drawn, per distance of the camera


def draw(vehicle: Path, picture: Path) -> str:
    """Write a picture of the vehicle with its arm stowed; return why there is none, "" if it is."""
    for platform in opengl.platforms():
        command = [sys.executable, "-m", "uam_lab.importing.picture", str(vehicle), str(picture)]
        try:
            done = subprocess.run(
                command,
                env=opengl.environment(platform),
                capture_output=True,
                timeout=LIMIT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return f"the renderer {platform} took more than {LIMIT:g} s"
        if done.returncode == 0:
            return ""
    return f"no renderer: {', '.join(opengl.platforms())} failed; uam doctor says why"


def bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, float]:
    """Return middle (3,) [m] and radius [m] of a ball around every shape of the vehicle."""
    geoms = np.flatnonzero(model.body_rootid[model.geom_bodyid] == model.body("base").id)
    here, reach = data.geom_xpos[geoms], model.geom_rbound[geoms, None]
    middle = ((here - reach).min(axis=0) + (here + reach).max(axis=0)) / 2.0
    return middle, float((np.linalg.norm(here - middle, axis=1) + reach[:, 0]).max())


def main() -> None:
    """Run the command line, see the docstring of the module."""
    parser = argparse.ArgumentParser(prog="python -m uam_lab.importing.picture")
    parser.add_argument("vehicle", metavar="NAME|FILE")
    parser.add_argument("picture", type=Path, metavar="picture.png")
    options = parser.parse_args()
    try:
        draw_here(options.vehicle, options.picture)
    except (ValueError, OSError) as error:
        parser.error(str(error))


def draw_here(name: str, file: Path) -> None:
    """Write the picture in this process. Raises ValueError for a bad vehicle, OSError."""
    opengl.choose()
    import mujoco
    from PIL import Image

    from uam_sim_bridge.plant import Vehicle
    from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

    plant = MujocoPlant(Vehicle.load(name).changed({"environment": []}), 0.0, seed=1)
    camera = mujoco.MjvCamera()
    camera.lookat[:], around = bounds(plant.model, plant.data)
    camera.distance, camera.azimuth, camera.elevation = AWAY * around, 145.0, -18.0
    plant.model.vis.map.znear = NEAREST * camera.distance / plant.model.stat.extent
    with mujoco.Renderer(plant.model, *SIZE) as renderer:
        renderer.update_scene(plant.data, camera)
        with replacing(file) as temporary:
            Image.fromarray(renderer.render()).save(temporary)


if __name__ == "__main__":
    main()

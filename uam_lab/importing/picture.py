"""Draws a vehicle: python -m uam_lab.importing.picture NAME|FILE picture.png

MuJoCo reads MUJOCO_GL at import, so `draw` does it in a process of its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PLATFORMS = ("egl", "osmesa")  # tried where MUJOCO_GL names none
SIZE = (480, 720)  # height, width [pixels]
LIMIT = 60.0  # [s]


def draw(vehicle: Path, picture: Path) -> str:
    """Write a picture of the vehicle with its arm stowed; return why there is none, "" if it is."""
    given = os.environ.get("MUJOCO_GL")
    for platform in (given,) if given else PLATFORMS:
        command = [sys.executable, "-m", "uam_lab.importing.picture", str(vehicle), str(picture)]
        try:
            done = subprocess.run(
                command,
                env=os.environ | {"MUJOCO_GL": platform},
                capture_output=True,
                timeout=LIMIT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return f"the renderer {platform} took more than {LIMIT:g} s"
        if done.returncode == 0:
            return ""
    return f"no renderer: {', '.join(PLATFORMS)} failed; uam doctor says why"


def main(name: str, file: str) -> None:
    """Write the picture in this process."""
    os.environ.setdefault("MUJOCO_GL", PLATFORMS[0])
    import mujoco
    import numpy as np
    from PIL import Image

    from uam_sim_bridge.plant import Vehicle
    from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

    plant = MujocoPlant(Vehicle.load(name).changed({"environment": []}), 0.0, seed=1)
    apart = [np.linalg.norm(one.position) for one in plant.vehicle.description.rotors]
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (0.0, 0.0, 0.6 * plant.data.qpos[2])
    camera.distance, camera.azimuth, camera.elevation = 0.25 + 4.1 * max(apart), 145.0, -18.0
    with mujoco.Renderer(plant.model, *SIZE) as renderer:
        renderer.update_scene(plant.data, camera)
        Image.fromarray(renderer.render()).save(file)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Draws a vehicle: python docs/draw_vehicle.py NAME|FILE picture.png (MUJOCO_GL=egl or osmesa)."""

from __future__ import annotations

import sys

import mujoco
from PIL import Image

from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant

SIZE = (480, 720)  # height, width [pixels]
HEIGHT = 1.0  # of the base [m]


def draw(name: str, file: str) -> None:
    """Write a picture of the vehicle with its arm stowed."""
    plant = MujocoPlant(Vehicle.load(name), 0.0, seed=1)
    plant.data.qpos[2] = HEIGHT
    mujoco.mj_forward(plant.model, plant.data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (0.0, 0.0, HEIGHT - 0.1)
    camera.distance, camera.azimuth, camera.elevation = 1.25, 145.0, -18.0
    with mujoco.Renderer(plant.model, *SIZE) as renderer:
        renderer.update_scene(plant.data, camera)
        Image.fromarray(renderer.render()).save(file)


if __name__ == "__main__":
    draw(*sys.argv[1:])

"""Child process of the rendering check: render one picture of the vehicle, without a screen.

MUJOCO_GL=egl python -m uam_lab.doctor.frame
"""

from __future__ import annotations

import sys
import time

from uam_lab.doctor.check_process import say

HEIGHT, WIDTH = 240, 320
FRAMES = 3


def main() -> int:
    """Render; print the renderer and its speed; return the exit status."""
    try:
        import mujoco

        from uam_sim_bridge.plant import Vehicle

        model = Vehicle.load().compile(0.0)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
        renderer.update_scene(data)
        renderer.render()  # the first one also compiles shaders
        begun = time.perf_counter()
        for _ in range(FRAMES):
            picture = renderer.render()
        say(
            frame_s=(time.perf_counter() - begun) / FRAMES,
            contrast=float(picture.std()),
            device=_device(),
        )
        renderer.close()
    except Exception as error:  # MuJoCo, PyOpenGL and GLFW raise different types
        print(f"{type(error).__name__}: {error}".splitlines()[0])
        return 1
    return 0


def _device() -> str:
    """Return the name of OpenGL's renderer, empty if unknown."""
    try:
        from OpenGL import GL

        return GL.glGetString(GL.GL_RENDERER).decode()
    except Exception:
        return ""


if __name__ == "__main__":
    sys.exit(main())

"""Check of offscreen rendering: one frame, its OpenGL renderer and its speed.

A child process renders the frame: MUJOCO_GL=egl python -m uam_lab.preflight.doctor.rendering
"""

import sys
import time
from collections.abc import Iterator

from uam_lab.preflight.doctor.check_process import TOO_LATE, CheckProcess, Said, say
from uam_lab.preflight.doctor.finding import Finding, ok, warn
from uam_lab.report.video import opengl
from uam_lab.report.video.flight_video import HOW_TO_GET_ONE

MODULE = "uam_lab.preflight.doctor.rendering"
HEIGHT, WIDTH = 240, 320
FRAMES = 3
PATIENCE = 30.0  # [s] for one platform
SOFTWARE = ("llvmpipe", "softpipe", "swrast")


def checks() -> Iterator[Finding]:
    """Yield the finding for the first platform that renders, in the order of the report."""
    problem = ""
    for platform in opengl.platforms():
        with CheckProcess(MODULE, environment={opengl.VARIABLE: platform}) as child:
            said = child.wait(PATIENCE)
        if "frame_s" in said.facts:
            yield drawn(platform, said)
            return
        problem = problem or f"{opengl.VARIABLE}={platform}: {said.problem}"
    if TOO_LATE in problem:
        yield warn(
            "rendering",
            problem,
            "the machine is busy or the driver hangs: try again, or try another MUJOCO_GL",
        )
        return
    what, _, how = HOW_TO_GET_ONE.partition("; ")
    yield warn("rendering", f"{what} ({problem[:160]})", how)


def drawn(platform: str, said: Said) -> Finding:
    facts = said.facts
    device = facts["device"] or "unknown renderer"
    kind = ", in software" if any(word in device for word in SOFTWARE) else ""
    found = f"{platform}: a frame in {1e3 * facts['frame_s']:.0f} ms by {device}{kind}"
    if facts["contrast"] < 1.0:
        return warn("rendering", f"{found}, but it is empty", "try another MUJOCO_GL: egl, glfw")
    return ok("rendering", found)


def main() -> int:
    """In the child: render one picture of the vehicle, print renderer and speed; exit status."""
    try:
        import mujoco  # at import it selects the OpenGL of MUJOCO_GL

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

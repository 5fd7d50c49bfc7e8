"""The OpenGL platforms that draw without a screen.

MuJoCo reads the variable MUJOCO_GL when it is imported. So each platform is tried in a process of
its own.
"""

import os

VARIABLE = "MUJOCO_GL"
FALLBACKS = ("egl", "osmesa")  # they need neither screen nor GPU


def platforms() -> tuple[str, ...]:
    """Return the platforms in the order of trial: that of MUJOCO_GL, if it is set, then others."""
    return tuple(dict.fromkeys(filter(None, (os.environ.get(VARIABLE), *FALLBACKS))))


def environment(platform: str) -> dict[str, str]:
    """Return the environment of a process that draws with `platform`."""
    return os.environ | {VARIABLE: platform}


def choose() -> None:
    """Select the first platform for this process; call it before the import of MuJoCo."""
    os.environ[VARIABLE] = platforms()[0]

"""MuJoCo's step for compiled functions: one call from Python for all physics steps of a tick.

The step is called in the library that the package `mujoco` contains, with the addresses of model
and data. It is the same function that `mujoco.mj_step` calls. An internal error of MuJoCo
(mju_error) ends the process here, where `mujoco.mj_step` raises an exception.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import mujoco

from uam_control.maths import compiled

_LIBRARY = str(next(Path(mujoco.__file__).parent.glob("libmujoco*")))


def _compiled_step():
    """Return mj_step(model, data) for compiled functions, by its name in the library."""
    from llvmlite import binding
    from numba import types

    binding.load_library_permanently(_LIBRARY)
    return types.ExternalFunction("mj_step", types.void(types.intp, types.intp))


def _plain_step():
    """Return mj_step(model, data) for plain Python."""
    function = ctypes.CDLL(_LIBRARY).mj_step
    function.argtypes, function.restype = (ctypes.c_void_p, ctypes.c_void_p), None
    return function


mj_step = _compiled_step() if compiled.active() else _plain_step()

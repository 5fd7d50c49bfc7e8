"""MuJoCo's step for compiled functions: one call from Python for all physics steps of a tick.

The step is called in the library that the package `mujoco` contains, with the addresses of model
and data. It is the same function that `mujoco.mj_step` calls.

An internal error of MuJoCo (mju_error) does not return to its caller: by default it ends the
process. MuJoCo calls `mju_user_error` before, and a handler in C leaves the step by a long jump, as
in MuJoCo's own Python package. numba cannot express setjmp, therefore the few lines around the step
are LLVM's assembly. They are for one thread, which has Python's lock during the step.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

import mujoco

from uam_control.maths import compiled

_LIBRARY = str(next(Path(mujoco.__file__).parent.glob("libmujoco*")))
_NAME = "uam_guarded_mj_step"
_GUARD = f"""
@jump = internal global [1024 x i8] zeroinitializer, align 16
@message = internal global [1024 x i8] zeroinitializer
@mju_user_error = external global ptr
declare i32 @_setjmp(ptr) returns_twice
declare void @longjmp(ptr, i32) noreturn
declare ptr @strncpy(ptr, ptr, i64)
declare void @mj_step(ptr, ptr)

define internal void @failed(ptr %text) {{
  call ptr @strncpy(ptr @message, ptr %text, i64 1023)
  call void @longjmp(ptr @jump, i32 1)
  unreachable
}}

define ptr @{_NAME}(ptr %model, ptr %data) {{
begin:
  %again = call i32 @_setjmp(ptr @jump) returns_twice
  %first = icmp eq i32 %again, 0
  br i1 %first, label %step, label %end
step:
  store ptr @failed, ptr @mju_user_error
  call void @mj_step(ptr %model, ptr %data)
  br label %end
end:
  %text = phi ptr [ null, %step ], [ @message, %begin ]
  store ptr null, ptr @mju_user_error
  ret ptr %text
}}
"""


_GUARD_OWNER: list[object] = []  # of its machine code: it stays until the process ends


def _compiled_step() -> Callable[[int, int], int]:
    """Return mj_step(model, data) for compiled functions."""
    from llvmlite import binding
    from numba import types

    binding.load_library_permanently(_LIBRARY)
    binding.initialize_native_target()  # numba does so at its first function only
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine()
    _GUARD_OWNER.append(binding.create_mcjit_compiler(binding.parse_assembly(_GUARD), machine))
    _GUARD_OWNER[0].finalize_object()
    binding.add_symbol(_NAME, _GUARD_OWNER[0].get_function_address(_NAME))
    return types.ExternalFunction(_NAME, types.intp(types.intp, types.intp))


def _plain_step() -> Callable[[int, int], int | None]:
    """Return mj_step(model, data) for plain Python, where an internal error ends the process."""
    function = ctypes.CDLL(_LIBRARY).mj_step
    function.argtypes, function.restype = (ctypes.c_void_p, ctypes.c_void_p), None
    return function


# 0, or the address of the text of an internal error, valid until the next one
mj_step = _compiled_step() if compiled.active() else _plain_step()


def error_text(address: int) -> str:
    """Return the text of an error of `mj_step`, in one line."""
    text = ctypes.string_at(address).decode(errors="replace")
    return " ".join(text.split())

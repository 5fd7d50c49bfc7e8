"""MuJoCo's step for compiled functions: one call from Python for all physics steps of a tick.

The step is called in the library that the package `mujoco` contains, with the addresses of model
and data. It is the same function that `mujoco.mj_step` calls.

An internal error of MuJoCo (mju_error) does not return to its caller: by default it ends the
process. MuJoCo calls `mju_user_error` before, and a handler in C leaves the step by a long jump, as
in MuJoCo's own Python package. numba cannot express setjmp, therefore the few lines around the step
are LLVM's assembly. They are for one thread, which has Python's lock during the step.

After a warning (`mju_user_warning`) MuJoCo goes on with what is not the vehicle: a state that is
not finite is set back to the model's initial one, contacts without memory are left out. So the step
returns its text as that of an error.
"""

import ctypes
from collections.abc import Callable
from pathlib import Path

import mujoco

from uam_control.maths import compiled
from uam_sim_bridge.plant.plant import PhysicsError

_LIBRARY = str(next(Path(mujoco.__file__).parent.glob("libmujoco*")))
_NAME = "uam_guarded_mj_step"
_GUARD = f"""
@jump = internal global [1024 x i8] zeroinitializer, align 16
@message = internal global [1024 x i8] zeroinitializer
@warning = internal global ptr null
@mju_user_error = external global ptr
@mju_user_warning = external global ptr
declare i32 @_setjmp(ptr) returns_twice
declare void @longjmp(ptr, i32) noreturn
declare ptr @strncpy(ptr, ptr, i64)
declare void @mj_step(ptr, ptr)

define internal void @failed(ptr %text) {{
  call ptr @strncpy(ptr @message, ptr %text, i64 1023)
  call void @longjmp(ptr @jump, i32 1)
  unreachable
}}

define internal void @warned(ptr %text) {{
  call ptr @strncpy(ptr @message, ptr %text, i64 1023)
  store ptr @message, ptr @warning
  ret void
}}

define ptr @{_NAME}(ptr %model, ptr %data) {{
begin:
  %again = call i32 @_setjmp(ptr @jump) returns_twice
  %first = icmp eq i32 %again, 0
  br i1 %first, label %step, label %end
step:
  store ptr @failed, ptr @mju_user_error
  store ptr @warned, ptr @mju_user_warning
  store ptr null, ptr @warning
  call void @mj_step(ptr %model, ptr %data)
  %found = load ptr, ptr @warning
  br label %end
end:
  %text = phi ptr [ %found, %step ], [ @message, %begin ]
  store ptr null, ptr @mju_user_error
  store ptr null, ptr @mju_user_warning
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


def _plain_step() -> Callable[[int, int], int]:
    """Return mj_step(model, data) for plain Python, where an internal error ends the process."""
    library = ctypes.CDLL(_LIBRARY)
    library.mj_step.argtypes, library.mj_step.restype = [ctypes.c_void_p] * 2, None
    message = ctypes.create_string_buffer(1024)

    @ctypes.CFUNCTYPE(None, ctypes.c_char_p)
    def warned(text: bytes) -> None:
        message.value = text[:1023]

    handler = ctypes.c_void_p.in_dll(library, "mju_user_warning")
    ours = ctypes.cast(warned, ctypes.c_void_p)  # keeps the function

    def step(model: int, data: int) -> int:
        message.value, handler.value = b"", ours.value
        library.mj_step(model, data)
        handler.value = None
        return ctypes.addressof(message) if message.value else 0

    return step


# 0, or the address of the text of an error or warning, valid until the next one
mj_step = _compiled_step() if compiled.active() else _plain_step()


def failure(address: int, model: mujoco.MjModel) -> PhysicsError:
    """Return the error of a step that ended with a text at `address`, in one line."""
    text = " ".join(ctypes.string_at(address).decode(errors="replace").split())
    if "unstable" not in text:
        return PhysicsError(f"MuJoCo: {text}")
    return PhysicsError(
        "it is unstable; its parts need softer springs, dampers and contacts, more inertia, or a "
        f"timestep below {model.opt.timestep:g} s (MuJoCo: {text})"
    )

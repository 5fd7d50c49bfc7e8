"""LLVM's assembly as machine code, for the few functions that numba cannot express.

Only where functions are compiled (`compiled.active`): numba brings LLVM.
"""

from __future__ import annotations

_owners: list[object] = []  # of machine code: it stays until the process ends


def machine_code(assembly: str, name: str) -> int:
    """Return the address of the function `name` in `assembly`."""
    from llvmlite import binding

    binding.initialize_native_target()  # numba does so at its first function only
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine()
    owner = binding.create_mcjit_compiler(binding.parse_assembly(assembly), machine)
    owner.finalize_object()
    _owners.append(owner)
    return owner.get_function_address(name)

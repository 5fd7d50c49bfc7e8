"""Hardware Error Status (register 70) in words, with what to do. Source: ROBOTIS e-manual."""

from __future__ import annotations

ERROR_BITS = {
    "input voltage": 0,
    "overheating": 2,
    "encoder": 3,
    "electrical shock": 4,
    "overload": 5,
}
ADVICE = {
    "input voltage": "supply outside the servo's limits: check battery and cable",
    "overheating": "let it cool, then reboot; reduce the load",
    "encoder": "the motor does not follow its encoder: replace the servo",
    "electrical shock": "circuit or supply too weak: check supply and cable, then reboot",
    "overload": "torque above the servo's ability for too long: remove the load, then reboot",
}


def hardware_errors(status: int) -> list[str]:
    """Return the names of the errors in a Hardware Error Status."""
    known = [name for name, bit in ERROR_BITS.items() if status & 1 << bit]
    rest = status & ~sum(1 << bit for bit in ERROR_BITS.values())
    return known + ([f"unknown error 0x{rest:02x}"] if rest else [])


def advice(status: int) -> str:
    """Return the errors with what to do, "" without one."""
    return "; ".join(
        f"{name} ({ADVICE[name]})" if name in ADVICE else name for name in hardware_errors(status)
    )

"""Latency timer of an FTDI adapter: time for which it keeps received bytes back."""

from __future__ import annotations

from pathlib import Path

SYSFS = Path("/sys/bus/usb-serial/devices")


def latency_timer(device: str, sysfs: Path = SYSFS) -> float | None:
    """Return the latency timer [s] of a serial device; None for an adapter without one."""
    file = sysfs / Path(device).resolve().name / "latency_timer"
    try:
        return 1e-3 * int(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def advice(device: str) -> str:
    """Return the command that sets the timer to 1 ms."""
    name = Path(device).resolve().name
    return f"echo 1 | sudo tee {SYSFS}/{name}/latency_timer"

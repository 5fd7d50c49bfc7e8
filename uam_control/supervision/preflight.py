"""The pre-arm report: every quantity with its limit, before the vehicle may be armed."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from uam_control.coordinates import ARM, CHI, CHI_DOT, POSITION
from uam_control.settings.preflight_check import PreflightCheck
from uam_control.supervision.checks import CONTROLLERS, Checks
from uam_control.supervision.observation import Observation

# quantities that must be known; others (battery, temperature) may be missing
REQUIRED = ("mocap", "joint angles", CONTROLLERS, "autopilot")
UNKNOWN = "unknown"


def preflight(
    checks: Checks,
    seen: Observation,
    arm_start: Sequence[float],
    start_speed: float,
    start_arm_error: float,
) -> tuple[PreflightCheck, ...]:
    """Return the report of the newest tick.

    checks: updated with `seen`; arm_start (n,): angles of the arm at the start [rad]; start_speed
    [m/s], start_arm_error [rad]: limits of the vehicle's speed and of the arm's angle error.
    """
    return (*_limits(checks), *_at_rest(seen, arm_start, start_speed, start_arm_error))


def _limits(checks: Checks) -> Iterator[PreflightCheck]:
    for check, value, limit in checks.on_ground():
        known, bound = value != -math.inf, "at most" if check.sign > 0 else "at least"
        yield PreflightCheck(
            check.name,
            f"{check.sign * value:.3g} {check.unit}".strip() if known else UNKNOWN,
            f"{bound} {check.sign * limit:.3g} {check.unit}".strip(),
            value < limit if known else check.name not in REQUIRED,
        )


def _at_rest(
    seen: Observation, arm_start: Sequence[float], start_speed: float, start_arm_error: float
) -> Iterator[PreflightCheck]:
    yield PreflightCheck(
        "motors", "armed" if seen.armed else "disarmed", "disarmed", not seen.armed
    )
    held = seen.authority.released_to
    yield PreflightCheck("control", held or "free", "free", not held)
    failed = seen.authority.failed
    ready = "ready; after a kill the bridge must be started again"
    yield PreflightCheck("bridge", failed or "ready", ready, not failed)
    speed = float(np.linalg.norm(seen.state[CHI_DOT, POSITION]))
    limit = f"at most {start_speed:.3g} m/s"
    yield PreflightCheck("speed", f"{speed:.3g} m/s", limit, speed <= start_speed)
    away = float(np.max(np.abs(seen.state[CHI, ARM] - arm_start), initial=0.0))
    limit = f"at most {start_arm_error:.3g} rad from its start"
    yield PreflightCheck("arm", f"{away:.3g} rad", limit, away <= start_arm_error)

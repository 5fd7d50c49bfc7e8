"""Whether the autopilot's parameters are those that the bridge's mapping assumes."""

from __future__ import annotations

import math
from collections.abc import Iterator

from uam_sim_bridge.mavlink.setpoint import RateThrustParameters

_AXES = ("ROLLRATE", "PITCHRATE", "YAWRATE")
# read from the autopilot; those without a counterpart in the mapping are for the record
WATCHED = (
    *(f"MC_{axis}_{what}" for axis in _AXES for what in "PIDK"),
    "THR_MDL_FAC", "MPC_THR_HOVER", "COM_OF_LOSS_T",
)  # fmt: skip
_TOLERANCE = 1e-4  # relative: MAVLink carries 32-bit numbers


def expected(mapping: RateThrustParameters) -> dict[str, float]:
    """Return what the autopilot's parameters should be for the mapping to be right."""
    values = {"THR_MDL_FAC": mapping.thr_mdl_fac}
    for axis, p, k in zip(_AXES, mapping.rate_p, mapping.rate_k, strict=True):
        values[f"MC_{axis}_P"], values[f"MC_{axis}_K"] = p, k
    return values


def differences(mapping: RateThrustParameters, values: dict[str, float]) -> Iterator[str]:
    """Yield one line for each parameter in `values` that disagrees with the mapping."""
    for name, wanted in expected(mapping).items():
        found = values.get(name)
        if found is not None and not math.isclose(
                found, wanted, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE):
            yield f"{name} is {found:g} on the autopilot, the bridge assumes {wanted:g}"

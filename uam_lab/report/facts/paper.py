"""The paper's RMS errors: tables table:error_p, table:error_q, table:error_alpha; proposed law."""

from __future__ import annotations

RMS = {
    "position_m": (0.05, 0.02, 0.09),
    "attitude_deg": (3.11, 2.81, 3.01),
    "arm_deg": (1.19, 1.16),
}
# (group of metrics.json, heading, unit, digits, names of the columns)
TABLES = (
    ("position_m", "position", "m", 3, ("x", "y", "z")),
    ("attitude_deg", "attitude", "°", 2, ("roll", "pitch", "yaw")),
    ("arm_deg", "arm", "°", 2, ("α₁", "α₂")),
)

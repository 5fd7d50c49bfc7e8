"""The paper's RMS errors: tables table:error_p, table:error_q, table:error_alpha; proposed law."""

SCENARIO = "pick_and_place"  # the mission of the figures
RMS = {
    "position_m": (0.05, 0.02, 0.09),
    "attitude_deg": (3.11, 2.81, 3.01),
    "arm_deg": (1.19, 1.16),
}
SUBSCRIPTS = "₁₂₃₄₅₆₇"


def joint_labels(joints: int) -> tuple[str, ...]:
    """Return the labels of the joints: α₁ .. αₙ."""
    return tuple(f"α{SUBSCRIPTS[i]}" for i in range(joints))


def tables(joints: int) -> tuple[tuple[str, str, str, int, tuple[str, ...]], ...]:
    """Return (group of metrics.json, heading, unit, digits, names of the columns)."""
    return (
        ("position_m", "position", "m", 3, ("x", "y", "z")),
        ("attitude_deg", "attitude", "°", 2, ("roll", "pitch", "yaw")),
        ("arm_deg", "arm", "°", 2, joint_labels(joints)),
    )


def published(group: str, count: int) -> tuple[float | None, ...]:
    """Return the paper's figures of a group, None for axes that its vehicle does not have."""
    known = RMS[group][:count]
    return known + (None,) * (count - len(known))

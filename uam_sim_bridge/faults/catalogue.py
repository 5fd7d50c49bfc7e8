"""Every fault there is, by name; and the same as a table."""

from __future__ import annotations

from uam_control.settings.parameter_set import Bound, Choice, ParameterError
from uam_sim_bridge.faults import (
    actuator_faults,
    imu_faults,
    link_faults,
    mocap_faults,
    process_faults,
)
from uam_sim_bridge.faults.fault import Fault, FaultError

FAULTS: dict[str, type[Fault]] = {
    kind.NAME: kind
    for kind in (
        mocap_faults.MocapDropout,
        mocap_faults.MocapFreeze,
        mocap_faults.MocapJump,
        mocap_faults.MocapSwap,
        mocap_faults.MocapLatency,
        mocap_faults.MocapOutliers,
        mocap_faults.ClockJump,
        imu_faults.ImuBias,
        imu_faults.ImuSaturation,
        imu_faults.ImuDropout,
        imu_faults.EncoderStuck,
        actuator_faults.ServoWeak,
        actuator_faults.ServoJam,
        actuator_faults.MagnetWeak,
        actuator_faults.MagnetStuck,
        actuator_faults.PayloadSwing,
        actuator_faults.MotorLoss,
        actuator_faults.BatterySag,
        actuator_faults.WindGust,
        link_faults.MavlinkCut,
        link_faults.MavlinkDelay,
        link_faults.MavlinkCorruption,
        process_faults.NodeKill,
        process_faults.NodeStall,
        process_faults.NodeSlow,
        process_faults.DiscoveryLoss,
    )
}
WHOLE = ("joint", "motor")  # parameters that count something


def make(name: object, values: dict[str, object]) -> Fault:
    """Return a fault by name with these parameters; raises FaultError in one line."""
    if not isinstance(name, str) or name not in FAULTS:
        raise FaultError(f"unknown fault {name!r}; there are: {', '.join(FAULTS)}")
    for parameter, value in values.items():
        if parameter not in FAULTS[name].specs():
            known = ", ".join(FAULTS[name].specs()) or "none"
            raise FaultError(f"{name}: {parameter}: unknown parameter; there are: {known}")
        if parameter in WHOLE and isinstance(value, float) and not value.is_integer():
            raise FaultError(f"{name}: {parameter}: {value!r} is not a whole number")
    try:
        return FAULTS[name].from_mapping(values)
    except ParameterError as error:
        raise FaultError(f"{name}: {error}") from None


def table() -> str:
    """The catalogue as a table in Markdown, as docs/faults.md has it."""
    lines = ["| fault | does | acts on | parameters (range: default) |", "|---|---|---|---|"]
    for name, kind in FAULTS.items():
        words = "; ".join(parameters(kind)) or "–"
        lines.append(f"| `{name}` | {kind.ABOUT} | {kind.PLACE} | {words} |")
    return "\n".join(lines) + "\n"


def listing() -> str:
    """The catalogue for a terminal."""
    lines = []
    for name, kind in FAULTS.items():
        lines.append(f"{name:<20}{kind.ABOUT} [{kind.PLACE}]")
        lines += [f"{'':<20}  {word.replace('`', '')}" for word in parameters(kind)]
    return "\n".join(lines)


def parameters(kind: type[Fault]) -> list[str]:
    """Each of its parameters in words: meaning, then range or choices, and the default."""
    words, usual = [], kind()
    for name, spec in kind.specs().items():
        default = getattr(usual, name)
        if isinstance(spec, Bound):
            unit = "" if spec.unit == "1" else f" {spec.unit}"
            span = f"{spec.low:.4g} to {spec.high:.4g}{unit}: {default:.4g}"
            words.append(f"`{name}`: {spec.description} ({span})")
        elif isinstance(spec, Choice):
            chosen = ", ".join(spec.choices)
            words.append(f"`{name}`: {spec.description} ({chosen}: {default})")
    return words

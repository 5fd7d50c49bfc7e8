"""PX4's parameters for this vehicle: PX4's names and their values, from config/ and the user."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import yaml

from uam_control.settings import configuration, yaml_file
from uam_control.vehicle import VehicleDescription
from uam_sim_bridge.px4.px4_installation import Px4Error, Range

SIMULATION = "px4/sitl.yaml"  # of config/: settings of the simulation, the same for all vehicles
AIRFRAME = "SYS_AUTOSTART"  # PX4 selects the airframe before it sets parameters
SYSTEM = "MAV_SYS_ID"  # follows from the instance
_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")  # at most 16 bytes in MAVLink
# of modules that a build may lack; their values in SIMULATION switch the modules off
_OPTIONAL = ("MC_AT_EN", "IMU_GYRO_FFT_EN")
STARTED_LATE = "px4-rc.simulator"  # script of PX4, found by PATH
_MOTOR = 100  # output functions: the last number before the first motor
Value = int | float


def load(
    vehicle: VehicleDescription,
    files: Sequence[str | Path] | None = None,
    given: Sequence[str] = (),
    ranges: Mapping[str, Range] | None = None,
) -> dict[str, Value]:
    """Merge the vehicle's parameters, YAML files of `NAME: value`, and texts NAME=VALUE.

    files None: SIMULATION; given: go before the files; ranges: of the build, which they must meet.
    Integers stay integers: PX4 requires them for INT32 parameters. Raises Px4Error.
    """
    values: dict[str, Value] = dict(vehicle.autopilot_parameters())
    for file in files or [configuration.path(SIMULATION)]:
        values |= _read(Path(file))
    return values | parse(given, ranges)


def output(number: int) -> str:
    """Return the parameter of an output of a build for a computer; HIL_ACT_FUNC on a board."""
    return f"PWM_MAIN_FUNC{number}"


def motor_outputs(vehicle: VehicleDescription) -> dict[str, Value]:
    """Return the outputs of a build for a computer: motor n at output n.

    PX4's airframe of a simulated quadrotor has the first four only.
    """
    return {output(n): _MOTOR + n for n in range(1, len(vehicle.rotors) + 1)}


def parse(given: Iterable[str], ranges: Mapping[str, Range] | None = None) -> dict[str, Value]:
    """Return name → value of texts NAME=VALUE. Raises Px4Error in one line: what is allowed.

    ranges: of the build; None or empty: names, types and limits are not checked.
    """
    values: dict[str, Value] = {}
    for text in given:
        name, equals, number = text.partition("=")
        if not equals:
            raise Px4Error(f"PX4 parameter '{text}': NAME=VALUE expected, as COM_OF_LOSS_T=0.5")
        try:
            value: Value = int(number) if re.fullmatch(r"[+-]?\d+", number) else float(number)
        except ValueError:
            raise Px4Error(f"PX4 parameter {name}: '{number}' is not a number") from None
        _check(name, value, "PX4 parameter")
        if name == SYSTEM:
            raise Px4Error(f"PX4 parameter {SYSTEM}: follows from --instance")
        values[name] = _ranged(name, value, ranges) if ranges else value
    return values


def _ranged(name: str, value: Value, ranges: Mapping[str, Range]) -> Value:
    allowed = ranges.get(name)
    if allowed is None:
        raise Px4Error(f"PX4 parameter {name}: this build of PX4 has none of this name")
    if allowed.integer and value != int(value):
        raise Px4Error(f"PX4 parameter {name}: {value:g} is not an integer")
    if not allowed.low <= value <= allowed.high:
        limits = f"{allowed.low:g} to {allowed.high:g}"
        raise Px4Error(f"PX4 parameter {name}: {value:g} is out of range; allowed: {limits}")
    return int(value) if allowed.integer else float(value)


def environment(values: Mapping[str, Value]) -> dict[str, str]:
    """Return the environment variables for PX4's start script: the airframe."""
    return {f"PX4_{AIRFRAME}": f"{values[AIRFRAME]}"} if AIRFRAME in values else {}


def start_script(values: Mapping[str, Value]) -> str:
    """Return the text of a shell script for `STARTED_LATE` that sets the parameters.

    PX4's start script reads px4-rc.simulator after its own and the airframe's `param set-default`,
    and before it starts the modules; the original sets more defaults. A value set earlier and equal
    to the firmware's default would be replaced by these defaults.
    """
    return "\n".join(
        [
            "#!/bin/sh",
            "# parameters of this flight, after the defaults of the start script",
            f". ${{R}}etc/init.d-posix/{STARTED_LATE}",
            *set_lines(values),
            "",
        ]
    )


def set_lines(values: Mapping[str, Value]) -> list[str]:
    """Return the lines of a start script that set the parameters, except the airframe."""
    return [f"param set {name} {value}" for name, value in values.items() if name != AIRFRAME]


def required(values: Mapping[str, Value], in_the_loop: bool = False) -> str:
    """Return the list of required parameters of a flight, for `RequiredParameters.read`.

    in_the_loop: for a flight controller in HITL, which has its own airframe and no simulated
    battery.
    """
    skipped = (AIRFRAME, "SIM_") if in_the_loop else (AIRFRAME,)
    kept = {name: value for name, value in values.items() if not name.startswith(skipped)}
    kept |= {"SYS_HITL": 1} if in_the_loop else {}
    entries = {
        name: {"is": value, "why": "this flight's value"}
        | ({"optional": True} if name in _OPTIONAL else {})
        for name, value in kept.items()
    }
    return yaml.safe_dump({"flight": entries}, sort_keys=False)


def _read(file: Path) -> dict[str, Value]:
    values = yaml_file.read(file, Px4Error)
    if not isinstance(values, dict):
        raise Px4Error(f"{file}: 'NAME: value' lines expected")
    for name, value in values.items():
        _check(name, value, f"{file}:")
    return values


def _check(name: object, value: object, where: str) -> None:
    """Raise Px4Error if the name is none of PX4's form or the value is no finite number."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise Px4Error(f"{where} '{name}' is no PX4 parameter name: A-Z, 0-9, _, at most 16")
    if isinstance(value, bool) or not isinstance(value, Value) or not math.isfinite(value):
        raise Px4Error(f"{where} {name}: {value!r} is not a number")

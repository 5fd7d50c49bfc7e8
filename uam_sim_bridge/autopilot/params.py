"""The autopilot's parameters: PX4's names, units, ranges and v1.16 defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from uam_control.settings import configuration, yaml_file
from uam_control.settings.parameter_set import ParameterError
from uam_control.settings.texts import unknown
from uam_control.vehicle import VehicleDescription


@dataclass(frozen=True)
class Definition:
    """Default, range and unit of one parameter; `integer`: sent as INT32 over MAVLink."""

    default: float
    low: float
    high: float
    unit: str
    description: str
    integer: bool = False


def _attitude(axis: str, text: str, p: float, high: float, limit: float) -> dict[str, Definition]:
    return {
        f"MC_{axis}_P": Definition(p, 0.0, high, "1/s", f"{text} P of the attitude loop"),
        f"MC_{axis}RATE_MAX": Definition(
            limit, 0.0, 1800.0, "deg/s", f"largest {text} rate of the attitude loop"
        ),
    }


def _axis(rate: str, limit: str, axis: str, p: float, i: float, d: float) -> dict[str, Definition]:
    return {
        f"MC_{rate}_P": Definition(p, 0.0, 2.0, "1/(rad/s)", f"{axis} rate P"),
        f"MC_{rate}_I": Definition(i, 0.0, 10.0, "1/rad", f"{axis} rate I"),
        f"MC_{rate}_D": Definition(d, 0.0, 0.1, "s/rad", f"{axis} rate D"),
        f"MC_{rate}_FF": Definition(0.0, 0.0, 2.0, "1/(rad/s)", f"{axis} rate feed-forward"),
        f"MC_{rate}_K": Definition(1.0, 0.01, 5.0, "1", f"{axis} rate gain on P, I, D"),
        f"MC_{limit}_INT_LIM": Definition(0.3, 0.0, 5.0, "1", f"{axis} rate integral limit"),
    }


ROTORS_MAX = 12  # as PX4's control allocation

DEFINITIONS: dict[str, Definition] = {
    "MAV_SYS_ID": Definition(1, 1, 250, "1", "system id", True),
    "MAV_COMP_ID": Definition(1, 1, 250, "1", "component id", True),
    **_axis("ROLLRATE", "RR", "roll", 0.15, 0.2, 0.003),
    **_axis("PITCHRATE", "PR", "pitch", 0.15, 0.2, 0.003),
    **_axis("YAWRATE", "YR", "yaw", 0.2, 0.1, 0.0),
    "MC_YAW_TQ_CUTOFF": Definition(2.0, 0.0, 10.0, "Hz", "low pass on the yaw torque; 0 off"),
    **_attitude("ROLL", "roll", 6.5, 12.0, 220.0),
    **_attitude("PITCH", "pitch", 6.5, 12.0, 220.0),
    **_attitude("YAW", "yaw", 2.8, 5.0, 200.0),
    "MC_YAW_WEIGHT": Definition(0.4, 0.0, 1.0, "1", "share of yaw in the attitude loop"),
    "IMU_GYRO_CUTOFF": Definition(40.0, 0.0, 1000.0, "Hz", "low pass on the gyro; 0 off"),
    "IMU_DGYRO_CUTOFF": Definition(20.0, 0.0, 1000.0, "Hz", "low pass on its derivative; 0 off"),
    "THR_MDL_FAC": Definition(0.0, 0.0, 1.0, "1", "thrust model factor"),
    "MPC_THR_HOVER": Definition(0.5, 0.1, 0.8, "1", "normalised thrust in hover"),
    "MPC_THR_MIN": Definition(0.12, 0.05, 1.0, "1", "smallest thrust of the failsafe descent"),
    "MPC_THR_MAX": Definition(1.0, 0.0, 1.0, "1", "largest thrust of the failsafe descent"),
    "MPC_MANTHR_MIN": Definition(0.08, 0.0, 1.0, "1", "thrust that counts as none when landed"),
    "MPC_LAND_SPEED": Definition(0.7, 0.2, 5.0, "m/s", "speed of the failsafe descent"),
    "MPC_Z_VEL_P_ACC": Definition(4.0, 2.0, 15.0, "1/s", "P of the descent-speed loop"),
    "MPC_Z_VEL_I_ACC": Definition(2.0, 0.2, 3.0, "1/s^2", "I of the descent-speed loop"),
    "MPC_Z_P": Definition(1.0, 0.1, 1.5, "1/s", "P of the height loop"),
    "MPC_XY_P": Definition(0.95, 0.0, 2.0, "1/s", "P of the horizontal position loop"),
    "MPC_XY_VEL_P_ACC": Definition(1.8, 1.2, 5.0, "1/s", "P of the horizontal velocity loop"),
    "MPC_XY_VEL_I_ACC": Definition(0.4, 0.0, 60.0, "1/s^2", "I of the horizontal velocity loop"),
    "MPC_XY_VEL_D_ACC": Definition(0.2, 0.1, 2.0, "1", "D of the horizontal velocity loop"),
    "MPC_Z_VEL_D_ACC": Definition(0.0, 0.0, 2.0, "1", "D of the vertical velocity loop"),
    "MPC_VELD_LP": Definition(5.0, 0.0, 50.0, "Hz", "low pass on the velocity's derivative"),
    "MPC_XY_VEL_MAX": Definition(12.0, 0.0, 20.0, "m/s", "largest horizontal velocity setpoint"),
    "MPC_Z_VEL_MAX_UP": Definition(3.0, 0.5, 8.0, "m/s", "largest velocity setpoint upwards"),
    "MPC_Z_VEL_MAX_DN": Definition(1.5, 0.5, 4.0, "m/s", "largest velocity setpoint downwards"),
    "MPC_THR_XY_MARG": Definition(0.3, 0.0, 0.5, "1", "thrust kept for the horizontal direction"),
    "MPC_ACC_DECOUPLE": Definition(
        1, 0, 1, "1", "vertical acceleration does not change the tilt", True
    ),
    "MPC_TILTMAX_AIR": Definition(45.0, 20.0, 89.0, "deg", "largest tilt of the position modes"),
    "MPC_VEL_MANUAL": Definition(10.0, 3.0, 20.0, "m/s", "speed of a full stick in POSITION"),
    "MPC_MAN_Y_MAX": Definition(150.0, 0.0, 400.0, "deg/s", "yaw rate of a full stick"),
    "COM_RC_LOSS_T": Definition(0.5, 0.0, 35.0, "s", "time without sticks before failsafe"),
    "COM_RC_OVERRIDE": Definition(
        1, 0, 7, "1", "stick movement takes over: bit 0 automatic modes, bit 1 OFFBOARD", True
    ),
    "COM_RC_STICK_OV": Definition(30.0, 5.0, 80.0, "%", "stick movement that takes over"),
    "COM_LOW_BAT_ACT": Definition(
        0, 0, 3, "1", "low battery: 0 warning, 2 land, 3 return, land when empty", True
    ),
    "BAT_LOW_THR": Definition(0.15, 0.12, 0.5, "1", "state of charge that warns"),
    "BAT_CRIT_THR": Definition(0.07, 0.05, 0.5, "1", "state of charge that acts"),
    "BAT_EMERGEN_THR": Definition(0.05, 0.03, 0.5, "1", "state of charge that always lands"),
    "SIM_BAT_ENABLE": Definition(0, 0, 1, "1", "simulate a battery", True),
    "SIM_BAT_DRAIN": Definition(60.0, 1.0, 86400.0, "s", "time from full to empty while armed"),
    "SIM_BAT_MIN_PCT": Definition(50.0, 0.0, 100.0, "%", "state of charge that is not undercut"),
    "COM_OF_LOSS_T": Definition(1.0, 0.0, 60.0, "s", "time without setpoints before failsafe"),
    "COM_KILL_DISARM": Definition(5.0, 0.0, 30.0, "s", "disarm after the kill switch"),
    "RC_MAP_KILL_SW": Definition(0, 0, 18, "1", "channel of the kill switch; 0 none", True),
    "RC_KILLSWITCH_TH": Definition(0.75, 0.0, 1.0, "1", "share of the channel that engages it"),
    "EKF2_NOAID_TOUT": Definition(
        5e6, 5e5, 1e7, "us", "time without vision, then the vertical velocity is not valid", True
    ),
    "COM_DISARM_LAND": Definition(2.0, -1.0, 20.0, "s", "disarm after landing; <= 0 never"),
    "COM_DISARM_PRFLT": Definition(10.0, -1.0, 200.0, "s", "disarm without take-off; <= 0 never"),
    "LNDMC_TRIG_TIME": Definition(1.0, 0.1, 10.0, "s", "time until landed is reported"),
    "LNDMC_Z_VEL_MAX": Definition(0.25, 0.0, 10.0, "m/s", "vertical speed when landed"),
    "LNDMC_XY_VEL_MAX": Definition(1.5, 0.0, 10.0, "m/s", "horizontal speed when landed"),
    "LNDMC_ROT_MAX": Definition(20.0, 0.0, 1000.0, "deg/s", "rotation when landed"),
    "CA_ROTOR_COUNT": Definition(0, 0, ROTORS_MAX, "1", "number of rotors", True),
    **{
        f"CA_ROTOR{i}_{what}": Definition(default, -limit, limit, unit, f"rotor {i + 1} {text}")
        for i in range(ROTORS_MAX)
        for what, default, limit, unit, text in (
            ("PX", 0.0, 5.0, "m", "forward"),
            ("PY", 0.0, 5.0, "m", "right"),
            ("KM", 0.05, 1.0, "m", "moment per thrust, > 0 counter-clockwise"),
        )
    },
}


ANY = 1e9  # limit of a stored parameter


def _stored() -> dict[str, Definition]:
    """Return the parameters that the stand-in only stores, by name: those of config/px4."""
    values = {}
    for name in ("px4/stand_in.yaml", "px4/sitl.yaml"):
        values |= yaml_file.read(configuration.path(name), ParameterError)
    return {
        name: Definition(value, -ANY, ANY, "", "stored without effect", isinstance(value, int))
        for name, value in values.items()
        if name not in DEFINITIONS
    }


DEFINITIONS |= _stored()


class Parameters:
    """A complete set of values; the order of `names` is the index in PARAM_VALUE."""

    names = tuple(DEFINITIONS)

    def __init__(self, values: dict[str, float] | None = None) -> None:
        """Raises ParameterError on an unknown name or a value out of range."""
        self._values = {name: d.default for name, d in DEFINITIONS.items()}
        for name, value in (values or {}).items():
            self.set(name, value)

    @classmethod
    def of(cls, vehicle: VehicleDescription, file: Path | str | None = None) -> Parameters:
        """Return the parameters of a vehicle, overridden by a YAML file of lines `NAME: value`.

        Raises ParameterError in one line with the file's name, also if the rotor geometry (CA_*) of
        the file differs from the vehicle's.
        """
        derived = vehicle.autopilot_parameters()
        values = {} if file is None else yaml_file.read(Path(file), ParameterError)
        if not isinstance(values, dict):
            raise ParameterError(f"{file}: 'NAME: value' lines expected")
        for name in sorted(derived.keys() & values.keys()):
            if name.startswith("CA_") and values[name] != derived[name]:
                raise ParameterError(
                    f"{file}: {name}: {values[name]!r}, but {vehicle.file.name} makes it "
                    f"{derived[name]:g}"
                )
        try:
            return cls(derived | values)
        except ParameterError as error:
            where = file or f"{vehicle.file}: autopilot: {vehicle.autopilot}"
            raise ParameterError(f"{where}: {error}") from None

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def set(self, name: str, value: float) -> None:
        """Set one value; raises ParameterError with the allowed range, without a change."""
        definition = DEFINITIONS.get(name)
        if definition is None:
            raise ParameterError(f"autopilot parameter {name}: {unknown(name, DEFINITIONS)}")
        allowed = f"allowed: {definition.low:g} to {definition.high:g} {definition.unit}"
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(f"{name}: {value!r} is not a number; {allowed}")
        if not math.isfinite(value) or not definition.low <= value <= definition.high:
            raise ParameterError(f"{name}: {value:g} is out of range; {allowed}")
        if definition.integer and value != int(value):
            raise ParameterError(f"{name}: {value:g} is not an integer; {allowed}")
        self._values[name] = float(value)

    def vector(self, *names: str) -> list[float]:
        """Return the values of several names."""
        return [self._values[name] for name in names]

    def rotors(self) -> tuple[list[float], list[float], list[float]]:
        """Return px, py, km, each of length CA_ROTOR_COUNT [m]: see `effectiveness`."""
        rotors = range(int(self["CA_ROTOR_COUNT"]))
        px, py, km = (
            self.vector(*(f"CA_ROTOR{i}_{what}" for i in rotors)) for what in ("PX", "PY", "KM")
        )
        return px, py, km

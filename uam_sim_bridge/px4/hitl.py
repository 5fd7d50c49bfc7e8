"""Executable `px4_hitl`: PX4 in software as a flight controller in HITL, on serial lines.

    TELEM2 ◀─ serial line ─▶ companion        setpoints, vision, telemetry
    USB    ◀─ serial line ─▶ simulator        HIL_SENSOR in, HIL_ACTUATOR_CONTROLS out

It needs a build without lockstep (`make px4_sitl_nolockstep`): PX4's clock is then its own, as on a
flight controller. PX4's start scripts for the simulator and for MAVLink are replaced: sensors,
commander and outputs start in HITL mode. Outputs 1 to N are the motors; 11 to 16 are the six of
MAV_CMD_DO_SET_ACTUATOR.

examples:
  px4_hitl --px4-dir build/px4_sitl_nolockstep --companion /dev/pts/3:921600
  px4_hitl --companion /dev/pts/3:921600 --usb /dev/pts/5   sensors on another line
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from functools import partial

from uam_control.vehicle import VehicleDescription, load_description
from uam_sim_bridge.mavlink.hil.sitl_ports import Program
from uam_sim_bridge.mavlink.transport.transport import parse_url
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.process import How, Px4Process, add_px4_options, command
from uam_sim_bridge.px4.px4_installation import LOOP_VARIABLE, Px4Installation

NAME = "px4_hitl"
MAVLINK = "px4-rc.mavlink"  # PX4's script that starts the links
USB_BAUD = 921600  # a USB device has none; PX4 asks for one
SHARE = 0.8  # of a line's bytes that PX4 may send
BITS_PER_BYTE = 10
ACTUATOR_SET, GRIPPER = 300, 430  # output functions: the last number before the first
OUTPUTS_OF_SET, FIRST_OF_SET = 6, 11  # outputs 11 to 16
# PX4 takes the computer's whole time so far for the time step of its first IMU sample, and an
# estimator that gets this sample begins after 5 % of that time. So it starts after the sample.
ESTIMATOR = """\
ekf2() {
    while said=$(px4-listener --instance $px4_instance sensor_combined -n 1); do
        case "$said" in *timestamp*) break ;; esac
        sleep 0.1
    done
    px4-ekf2 --instance $px4_instance "$@"
}"""


def loop_values(
    values: Mapping[str, parameters.Value], vehicle: VehicleDescription
) -> dict[str, parameters.Value]:
    """Return the parameters of PX4 in the loop: outputs, and no simulated battery unless given."""
    motors, output = parameters.motor_outputs(vehicle), parameters.output
    others = {output(FIRST_OF_SET + n): ACTUATOR_SET + 1 + n for n in range(OUTPUTS_OF_SET)}
    defaults = {"IMU_INTEG_RATE": 250}
    if not {"SIM_BAT_ENABLE", "SIM_BAT_DRAIN"} & values.keys():
        defaults |= {"SIM_BAT_ENABLE": 0, "SIM_BAT_DRAIN": 0}  # the second: PX4 v1.18
    return motors | others | defaults | dict(values) | {"SYS_HITL": 1, parameters.SYSTEM: 1}


def gripper_parameter(number: int) -> str:
    """Return NAME=VALUE that puts gripper `number`, 1 to 6, on the output of that actuator."""
    return f"{parameters.output(FIRST_OF_SET + number - 1)}={GRIPPER}"


def start_script(values: Mapping[str, parameters.Value]) -> str:
    """Return the script in place of PX4's start of a simulator."""
    return "\n".join(
        [
            "#!/bin/sh",
            "# parameters of this flight; no simulator at a port; sensors and commander for HITL",
            *parameters.set_lines(values),
            "unalias sensors commander ekf2",
            "sensors() { px4-sensors --instance $px4_instance start -h; }",
            "commander() { px4-commander --instance $px4_instance start -h; }",
            ESTIMATOR,
            "px4-pwm_out_sim --instance $px4_instance start -m hil",
            "",
        ]
    )


def mavlink_script(companion: str, baud: int, usb: str = "") -> str:
    """Return the script that starts the links; devices; usb "": the companion's carries both."""
    rate = round(SHARE * baud / BITS_PER_BYTE)
    lines = [f"mavlink start -d {companion} -b {baud} -m onboard -r {rate}"]
    if usb:
        rate = round(SHARE * USB_BAUD / BITS_PER_BYTE)
        lines += [
            f"mavlink start -d {usb} -b {USB_BAUD} -m custom -r {rate}",
            f"mavlink stream -d {usb} -s GPS_GLOBAL_ORIGIN -r 1",
        ]
    return "\n".join(["#!/bin/sh", *lines, ""])


def parser() -> Program:
    p = Program(__doc__)
    p.instance()
    p.option("--companion", "DEVICE:BAUD", "the companion's line, as TELEM2", required=True)
    text = "line of the simulated sensors and motors (default: the companion's)"
    p.option("--usb", "DEVICE", text, "")
    add_px4_options(p, f"PX4 build without lockstep (default: ${LOOP_VARIABLE})")
    p.vehicle()
    return p


def prepared(options: argparse.Namespace) -> How:
    """Return how PX4 runs. Raises what `command` reports."""
    line = parse_url(f"serial:{options.companion}")
    installation = Px4Installation.find(options.px4_dir, LOOP_VARIABLE)
    vehicle = load_description(options.vehicle)
    given = parameters.load(vehicle, options.params, options.param, installation.ranges())
    values = loop_values(given, vehicle)
    scripts = {
        parameters.STARTED_LATE: start_script(values),
        MAVLINK: mavlink_script(line.place, line.number, options.usb),
    }
    variables = parameters.environment(values)
    start = partial(Px4Process, installation, options.instance, scripts, variables)
    return How(start, options.log)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run PX4 until interrupted; return the exit status, see `command`."""
    return command(NAME, parser().parse_args(arguments), prepared)


if __name__ == "__main__":
    sys.exit(main())

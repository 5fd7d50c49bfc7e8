"""Checks of the devices of a lab file, without a flight: nothing is switched, no torque."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from uam_lab.flights.vehicle.devices import devices
from uam_lab.flights.vehicle.lab_file import GPIO, Lab
from uam_lab.preflight.doctor.finding import Finding, fail, ok
from uam_sim_bridge.devices.dynamixel.bus import BusLost
from uam_sim_bridge.devices.dynamixel.chain import ArmError
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.devices.mocap import measurement
from uam_sim_bridge.devices.mocap.frame import MocapError
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters, open_source

SLOW_ANSWER = 0.05  # [s] of a servo: this computer may be busy


def checks(lab: Lab) -> Iterator[Finding]:
    """Yield a finding for motion capture, arm and a magnet on a line."""
    advice = {one.name: one.advice for one in devices(lab)}
    if lab.mocap is not None:
        yield _tried("motion capture", advice, lambda: _mocap(lab.mocap))
    yield _tried("arm", advice, lambda: _arm(lab))
    if lab.magnet.through == GPIO:
        yield _tried("magnet", advice, lambda: _line(lab.magnet.line.chip))


def _tried(name: str, advice: dict[str, str], look: Callable[[], str]) -> Finding:
    try:
        return ok(name, look())
    except (MocapError, ArmError, OSError) as error:
        return fail(name, str(error), advice[name])


def _mocap(parameters: MocapParameters) -> str:
    source = open_source(parameters)
    try:
        measurement.until_known(source, parameters.body)
        return f"'{parameters.body}' of {source.description}"
    finally:
        source.close()


def _arm(lab: Lab) -> str:
    servos = lab.vehicle.numbers["servos"]
    p = ArmDriverParameters(answer_timeout=SLOW_ANSWER, write_settings=False)
    mode, gain = servos["mode"], servos["position_p_gain"]
    driver = ArmDriver(lab.arm, p, mode, lab.vehicle.control_period, gain)
    try:
        driver.start()
    except BusLost as error:
        raise ArmError(str(error)) from None
    finally:
        driver.bus.close()  # and not `stop`, which would end a torque that holds the arm
    return "; ".join((f"{len(lab.arm.servos)} servos on {lab.arm.device}", *driver.remarks))


def _line(chip: str) -> str:
    """Look at the chip only: opening the line would switch it."""
    path = Path(chip)
    if not path.exists():
        raise OSError(f"{chip}: does not exist")
    if not os.access(path, os.R_OK | os.W_OK):
        raise OSError(f"{chip}: may not be opened by this user")
    return chip

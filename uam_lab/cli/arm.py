"""`uam arm`: check the servos of the arm and the budget of their bus.

Compare the Dynamixel servos on the bus with the lab file, and print their state.

examples:
  uam arm --config my_lab.yaml             the servos of your lab file
  uam arm --config my_lab.yaml --write-settings       write what differs
  uam arm --device /dev/ttyUSB1 --scan     ids and models at every baud rate
  uam arm --budget                         time budget of the bus; no servos needed

Torque stays off. Exit status: 0 as described, 1 not, 2 wrong use or no device.
"""

import argparse
import dataclasses
import math
import time
from collections.abc import Callable

from rich.table import Table

from uam_control.vehicle import VehicleDescription
from uam_lab.cli.command import Command
from uam_lab.flights.vehicle.lab_file import lab_arm, lab_path, lab_vehicle, read_lab
from uam_lab.records.results.terminal import Terminal, say
from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel.bus import DynamixelBus, tried
from uam_sim_bridge.devices.dynamixel.chain import SPEEDS, ArmChain, ArmError
from uam_sim_bridge.devices.dynamixel.control_table import model_name
from uam_sim_bridge.devices.dynamixel.driver import NEEDED_LATENCY, ArmDriver
from uam_sim_bridge.devices.dynamixel.health import advice
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters

AS_DESCRIBED, OTHERWISE = 0, 1


def add(command: Command) -> None:
    command.arm_hardware()
    command.switch("--write-settings", "write operating mode, return delay and current limit")
    command.switch("--scan", "list ids and models at every baud rate, whatever is described")
    command.switch("--budget", "print the time budget of the bus; no servos needed")


def run(options: argparse.Namespace) -> int:
    if options.scan:
        return scan(described(options)[1], options.answer_timeout)
    driver = driver_of(options, write_settings=options.write_settings)
    if options.budget:
        if driver.latency_timer is None:
            driver.latency_timer = NEEDED_LATENCY
            say(f"no latency timer of {driver.chain.device} found: 1 ms assumed")
        say(driver.budget.table(driver.rate))
        return AS_DESCRIBED
    try:
        driver.start()
        rows = [state(driver, i) for i in range(len(driver.chain.arm))]
    except ArmError as error:
        say(str(error).replace("; ", "\n"))
        return OTHERWISE
    finally:
        driver.bus.close()  # and not `stop`, which would end a torque that holds the arm
    table = Table(
        *("joint", "id", "model", "firmware", "angle [deg]", "deg C", "V", "hardware error")
    )
    for row in rows:
        table.add_row(*row)
    Terminal().print(table)
    say(driver.budget.table(driver.rate))
    for remark in driver.remarks:
        say(remark)
    return AS_DESCRIBED


def described(options: argparse.Namespace) -> tuple[VehicleDescription, ArmChain]:
    """Return vehicle and chain of the lab file. Raises LabError, ConfigurationError."""
    lab = read_lab(lab_path(options.config))
    vehicle = lab_vehicle(lab)
    chain, _ = lab_arm(lab, vehicle)
    return vehicle, dataclasses.replace(chain, device=options.device) if options.device else chain


def driver_of(
    options: argparse.Namespace,
    clock: Callable[[], float] = time.monotonic,
    **parameters: object,
) -> ArmDriver:
    """Return the driver of the options, not started; clock: seconds; parameters: of the driver."""
    vehicle, chain = described(options)
    values = {"answer_timeout": options.answer_timeout} | parameters
    servos = vehicle.numbers["servos"]
    return ArmDriver(
        chain,
        ArmDriverParameters.from_mapping(values),
        servos["mode"],
        vehicle.control_period,
        servos["position_p_gain"],
        clock,
    )


def state(driver: ArmDriver, i: int) -> tuple[str, ...]:
    """Return the cells of servo i."""
    servo, angle = driver.chain.arm[i], driver.start_angles[i]
    firmware, heat, voltage = (
        tried(driver.bus.read, servo.id, servo.table[name])
        for name in (names.FIRMWARE, names.PRESENT_TEMPERATURE, names.PRESENT_VOLTAGE)
    )
    return (
        servo.joint,
        str(servo.id),
        servo.table.model,
        str(firmware),
        f"{math.degrees(angle):.1f}",
        str(heat),
        f"{voltage * names.VOLTAGE_UNIT:.1f}",
        advice(driver.health[i].error) or "none",
    )


def scan(chain: ArmChain, wait: float) -> int:
    """Print ids and models at every baud rate. Raises BusLost."""
    bus, found = DynamixelBus(chain.device, SPEEDS[0], wait), 0
    try:
        for speed in SPEEDS:
            bus.set_baud_rate(speed)
            for servo, (number, firmware) in bus.scan().items():
                say(f"{speed} baud: id {servo}, {model_name(number)}, firmware {firmware}")
                found += 1
    finally:
        bus.close()
    if not found:
        say(f"{chain.device}: no servo answers: supply, cable, Protocol 2.0?")
    return AS_DESCRIBED if found else OTHERWISE

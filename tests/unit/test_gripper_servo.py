"""The gripper's servo on the arm's bus: settings, goals, readings, a servo that falls silent."""

from __future__ import annotations

import math
import socket
from dataclasses import replace

import numpy as np
import pytest
import yaml
from arm_rig import BAUD, PATIENT, LinePort
from servo_shafts import StillShaft
from set_clock import SetClock

from uam_control.settings.section import Section
from uam_control.vehicle import load_description
from uam_lab.flights.vehicle.lab_file import template
from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ArmError, describe_chain
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver
from uam_sim_bridge.devices.dynamixel.emulated import ArmShafts, EmulatedServo, ServoLine
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.laboratory.laboratory import Laboratory
from uam_sim_bridge.laboratory.laboratory_parameters import LaboratoryParameters
from uam_sim_bridge.plant import Vehicle

VEHICLE = load_description("s500_gripper")
SERVO = {"id": 3, "model": "xm430_w350", "direction": -1, "zero": 1200}
COUNT = 0.03 * 2.0 * math.pi / 4096  # [m] of the opening
CURRENT = 0.00269 * 2.423 / 0.03  # [N] of one unit


def chain_with(vehicle=VEHICLE, **changes) -> ArmChain:
    """The arm of the template with the gripper's servo; changes: of the section."""
    document = yaml.safe_load(template())
    document["arm"] |= {"gripper": SERVO} | changes
    arm = {key: value for key, value in document["arm"].items() if value is not None}
    return describe_chain(Section({"arm": arm}, "lab.yaml:", ArmError), vehicle)


class Rig:
    """Driver, still joints, and fingers whose state is set by hand."""

    def __init__(self) -> None:
        self.clock, self.chain = SetClock(100.0), chain_with()
        self.fingers = ArmShafts([self.chain.gripper])
        shafts = [StillShaft(0.0), StillShaft(math.pi / 2), *self.fingers.shafts]
        models = [servo.table.model for servo in self.chain.servos]
        self.servos = [
            EmulatedServo(i, shaft, model, BAUD, clock=self.clock)
            for i, (shaft, model) in enumerate(zip(shafts, models, strict=True), 1)
        ]
        port = LinePort(ServoLine(self.servos))
        self.driver = ArmDriver(self.chain, ArmDriverParameters(), clock=self.clock, port=port)
        self.put(0.075, 0.0)
        self.driver.start()

    def put(self, opening: float, force: float) -> None:
        """Set opening [m] and closing force [N]."""
        self.fingers.set(*(np.array([one]) for one in (opening / 0.03, 0.0, -0.03 * force)))

    def cycle(self, count: int = 1):
        """Run cycles of 4 ms; return the last reading."""
        for _ in range(count):
            self.driver.command_effort(np.zeros(2))
            reading = self.driver.cycle()
            self.clock.now += 0.004
        return reading

    @property
    def goal(self) -> float:
        """Goal of the fingers [m]."""
        return 0.03 * self.fingers.command(True).item()


@pytest.fixture
def rig():
    return Rig()


def test_its_settings_are_those_of_a_current_based_position_mode(rig):
    """10 N at 0.03 m/rad are 0.3 N m; at 2.423 N m/A and 2.69 mA: 46 units. 0.06 m/s are 2 rad/s,
    at 0.229 rpm (0.02398 rad/s): 83 units."""
    said = "\n".join(rig.driver.remarks)
    assert (
        "gripper (id 3): Operating Mode was 3 (position), is now 5 (current-based position)" in said
    )
    assert "gripper (id 3): Current Limit was 1193, is now 46" in said
    rig.cycle()
    servo = rig.servos[2]
    assert servo.get("Goal Current") == 46 and servo.get("Profile Velocity") == 83
    assert rig.goal == pytest.approx(0.075, abs=COUNT)  # it holds where it is


def test_it_closes_and_opens_beside_the_arm(rig):
    rig.cycle()
    rig.driver.command_gripper(0.02)
    rig.cycle()
    assert rig.goal == pytest.approx(0.02, abs=COUNT)
    rig.driver.command_gripper(0.2)  # beyond its stroke
    rig.cycle()
    assert rig.goal == pytest.approx(0.075, abs=COUNT)
    assert rig.servos[0].get("Operating Mode") == 0


def test_opening_and_force_are_read(rig):
    rig.put(0.04, 5.0)
    reading = rig.cycle(2)
    assert reading.position == pytest.approx([0.0, math.pi / 2], abs=2e-3)
    assert reading.grip == pytest.approx([0.04, 5.0], abs=CURRENT)
    assert reading.grip[0] == pytest.approx(0.04, abs=COUNT)


def test_a_silent_gripper_is_a_problem_and_the_arm_goes_on(rig):
    rig.cycle(2)
    rig.servos[2].connected = False
    reading = rig.cycle(10)
    assert np.isnan(reading.grip).all() and np.isfinite(reading.position).all()
    assert "gripper (id 3): no answer" in "; ".join(rig.driver.problems)
    assert rig.driver.lost == []


@pytest.mark.parametrize(
    ("vehicle", "changes", "reason"),
    [
        ("s500_gripper", {"gripper": None}, "arm.gripper: missing; the vehicle has one"),
        ("s500_arm", {}, "arm.gripper: the vehicle has none on the bus"),
        ("s500_gripper", {"gripper": SERVO | {"id": 2}}, "each servo needs its own"),
        ("s500_gripper", {"gripper": SERVO | {"gear": 2}}, "gear"),
        ("s500_gripper", {"gripper": SERVO | {"model": "xm999"}}, "unknown servo model 'xm999'"),
    ],
)
def test_a_lab_file_that_does_not_fit_is_refused(vehicle, changes, reason):
    with pytest.raises(ArmError) as refused:
        chain_with(load_description(vehicle), **changes)
    assert reason in str(refused.value) and "\n" not in str(refused.value)


def test_the_fingers_of_the_plant_follow_the_emulated_servo(tmp_path):
    """0.055 m at 0.06 m/s: 0.92 s, or 230 ticks of 4 ms after the goal, in a rehearsal's room."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    where = {"folder": str(tmp_path), "hil_port": port, "mocap_port": 0}
    parameters = LaboratoryParameters(magnet="servo", payload_mass=0.0, **where)
    chain = chain_with()
    lab = Laboratory(Vehicle.of(VEHICLE), parameters, chain, calibration.load("motive_y_up"))
    patient = ArmDriverParameters(answer_timeout=min(PATIENT, 5.0), watchdog=0.0)
    driver = ArmDriver(replace(chain, device=lab.bus.port), patient)
    try:
        driver.start()
        driver.command_gripper(0.02)
        for tick in range(300):
            _, truth = lab.sense(1.8e9 + lab.plant.time)
            if tick % 20 == 0:
                driver.cycle()
            lab.step(np.zeros(4), truth)
        assert truth.grip[0] == pytest.approx(0.02, abs=2 * COUNT) and lab.magnet
        assert driver.cycle().grip[0] == pytest.approx(0.02, abs=2 * COUNT)
    finally:
        driver.stop()
        lab.close()

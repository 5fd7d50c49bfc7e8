"""`uam arm` on emulated servos behind a pseudo-terminal."""

from contextlib import closing

import pytest
from arm_rig import BAUD, STOWED
from servo_shafts import StillShaft

from uam_lab.cli.main import main
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedBus, EmulatedServo


@pytest.fixture
def bus():
    shafts = [StillShaft(angle) for angle in STOWED]
    servos = [EmulatedServo(i + 1, one, baud_rate=BAUD) for i, one in enumerate(shafts)]
    with closing(EmulatedBus(servos)) as made:
        yield made


def arm(bus, *options):
    return main(["arm", "--device", bus.port, "--answer-timeout", "5", *options])


def test_the_servos_are_compared_and_written(bus, capsys):
    assert arm(bus) == 1
    said = capsys.readouterr().out
    assert "alpha_1 (id 1): Operating Mode is 3 (position), 0 (current) is needed" in said
    assert arm(bus, "--write-settings") == 0
    assert "alpha_2 (id 2): Operating Mode was 3 (position), is now 0" in capsys.readouterr().out
    assert arm(bus) == 0
    said = capsys.readouterr().out
    assert "xm430_w210" in said and "90.0" in said and "250 Hz fits" in said
    assert not any(servo.shaft.last.on for servo in bus.line.servos)


def test_wrong_wiring_is_printed_line_by_line(bus, capsys):
    bus.line.servos[1].set("ID", 9)
    assert main(["arm", "--device", bus.port, "--answer-timeout", "0.3"]) == 1
    assert "ids on the bus: 1 (xm430_w210), 9 (xm430_w210)" in capsys.readouterr().out.splitlines()


def test_the_budget_needs_no_servos(capsys):
    assert main(["arm", "--budget"]) == 0
    said = capsys.readouterr().out
    assert "Fast Sync Read of the states" in said and "250 Hz fits" in said


def test_no_device(capsys):
    assert main(["arm", "--device", "/dev/ttyNONE"]) == 2
    assert capsys.readouterr().err == "uam arm: /dev/ttyNONE: does not exist\n"

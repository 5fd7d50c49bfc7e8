"""The magnet: rules without commands, through the autopilot, on a GPIO line."""

import math
from collections import deque
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from memory_transport import Memory

from uam_control.offboard.autopilot_magnet import (
    LATEST,
    PROGRESS_REPEAT,
    REFUSED_REPEAT,
    REPEAT,
    SILENT_AFTER,
    AutopilotMagnet,
    AutopilotMagnetParameters,
)
from uam_control.offboard.modes import MavCmd, MavResult
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.server import CONTROLS, Server
from uam_sim_bridge.devices.magnet import lines
from uam_sim_bridge.devices.magnet.lines import (
    FileLine,
    GpioLine,
    MagnetDriver,
    MagnetError,
    MagnetSwitching,
    SwitchingParameters,
)
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2

ACTUATOR = AutopilotMagnetParameters(magnet="actuator", magnet_output=2)
GRIPPER = AutopilotMagnetParameters(magnet="gripper", magnet_output=3)


def switching(**rules):
    return MagnetSwitching(SwitchingParameters(**rules).validated())


def test_before_the_first_command_it_is_off_and_nothing_is_lost():
    rules = switching(magnet_at_exit="hold")
    assert not rules.desired(1e6) and not rules.stale(1e6) and not rules.at_exit()


@given(st.booleans(), st.sampled_from(["hold", "release"]), st.floats(0.0, 10.0))
def test_lost_commands_hold_or_release_as_stated(on, rule, later):
    rules = switching(magnet_when_stale=rule, magnet_stale_after=2.0)
    rules.command(100.0, on)
    lost = later > 2.0
    now = 100.0 + later
    assert rules.stale(now) == (now - 100.0 > 2.0)
    assert rules.desired(now) == (on and not (lost and rule == "release"))
    rules.command(now, on)
    assert rules.desired(now) == on  # commands that come back count


@pytest.mark.parametrize(("rule", "left"), [("hold", True), ("release", False)])
def test_at_the_exit_it_is_left_as_stated(rule, left):
    rules = switching(magnet_at_exit=rule)
    rules.command(0.0, True)
    assert rules.at_exit() == left
    rules.command(1.0, False)
    assert not rules.at_exit()


def test_on_and_off_must_differ():
    with pytest.raises(ParameterError, match="magnet_on: 0.5 is also magnet_off"):
        AutopilotMagnetParameters(magnet_on=0.5, magnet_off=0.5).validated()


def test_the_actuator_is_set_and_the_others_are_left_alone():
    magnet = AutopilotMagnet(ACTUATOR)
    command, values = magnet.due(0.0)
    assert command == MavCmd.DO_SET_ACTUATOR == 187
    assert values[1] == -1.0 and values[6] == 0.0
    assert all(math.isnan(values[i]) for i in (0, 2, 3, 4, 5))
    assert magnet.answer(0.01, command, MavResult.ACCEPTED) and magnet.state is False
    magnet.switch(1.0, True)
    assert magnet.state is None and magnet.due(1.0)[1][1] == 1.0


def test_the_gripper_grabs_and_releases():
    magnet = AutopilotMagnet(GRIPPER)
    assert magnet.due(0.0) == (MavCmd.DO_GRIPPER, (3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    magnet.switch(0.1, True)
    assert magnet.due(0.1) == (MavCmd.DO_GRIPPER, (3.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert int(MavCmd.DO_GRIPPER) == 211


def test_a_request_is_repeated_until_it_is_acknowledged():
    magnet = AutopilotMagnet(ACTUATOR)
    assert magnet.due(0.0) and not magnet.due(0.5 * REPEAT) and magnet.due(REPEAT)
    assert not magnet.answer(0.3, MavCmd.ARM_DISARM, MavResult.ACCEPTED)
    assert magnet.answer(0.3, MavCmd.DO_SET_ACTUATOR, MavResult.ACCEPTED)
    assert magnet.settled and magnet.due(10.0) is None and magnet.requests == 2


def test_silence_and_refusals_are_said_and_asking_goes_on():
    magnet = AutopilotMagnet(ACTUATOR)
    for k in range(SILENT_AFTER):
        assert magnet.problem == ""
        assert magnet.due(k * REPEAT)
    assert magnet.problem == "magnet off: the autopilot does not answer"
    magnet.answer(2.0, MavCmd.DO_SET_ACTUATOR, MavResult.UNSUPPORTED)
    assert magnet.problem == "magnet off: the autopilot says unsupported"
    assert not magnet.due(2.0 + 0.9 * REFUSED_REPEAT) and magnet.due(2.0 + REFUSED_REPEAT)
    magnet.answer(3.1, MavCmd.DO_SET_ACTUATOR, MavResult.ACCEPTED)
    assert magnet.problem == "" and magnet.settled


def test_in_progress_is_no_answer_yet():
    magnet = AutopilotMagnet(GRIPPER)
    magnet.due(0.0)
    assert magnet.answer(0.1, MavCmd.DO_GRIPPER, MavResult.IN_PROGRESS)
    assert not magnet.settled
    # PX4 refuses requests while its gripper moves, one second by default
    assert not magnet.due(2.9) and magnet.problem == ""
    magnet.answer(0.5, MavCmd.DO_GRIPPER, MavResult.ACCEPTED)
    assert magnet.settled


def test_after_a_gripper_that_never_ends_the_request_is_repeated():
    magnet = AutopilotMagnet(GRIPPER)
    magnet.due(0.0)
    magnet.answer(0.1, MavCmd.DO_GRIPPER, MavResult.IN_PROGRESS)
    assert not magnet.due(0.1 + 0.9 * PROGRESS_REPEAT) and magnet.due(0.2 + PROGRESS_REPEAT)
    magnet.switch(3.5, True)  # another state is requested at once
    assert magnet.due(3.5)


def test_an_answer_to_the_state_before_does_not_count():
    magnet = AutopilotMagnet(ACTUATOR)
    magnet.switch(0.0, True)
    magnet.due(0.0)
    magnet.switch(0.1, False)
    magnet.due(0.1)
    magnet.answer(0.15, MavCmd.DO_SET_ACTUATOR, MavResult.ACCEPTED)  # that of "on"
    assert magnet.state is None
    magnet.answer(0.2, MavCmd.DO_SET_ACTUATOR, MavResult.ACCEPTED)
    assert magnet.state is False


@given(
    st.lists(st.tuples(st.booleans(), st.booleans(), st.booleans(), st.integers(0, 8)), max_size=80)
)
def test_what_is_acknowledged_is_what_the_autopilot_has(steps):
    """A line that loses messages both ways and delays them, in order; one step is 0.1 s."""
    magnet = AutopilotMagnet(ACTUATOR)
    autopilot, way_there, way_back = None, deque(), deque()
    for k, (on, lost_there, lost_back, delay) in enumerate(steps + [(True, False, False, 0)] * 40):
        now = 0.1 * k
        delay = min(delay, int(0.4 * LATEST / 0.1))
        magnet.switch(now, on)
        while way_there and way_there[0][0] <= k:
            autopilot = way_there.popleft()[1]
            if not lost_back:
                due = max([k + delay, *(due for due, _ in way_back)])
                way_back.append((due, MavResult.ACCEPTED))
        while way_back and way_back[0][0] <= k:
            magnet.answer(now, MavCmd.DO_SET_ACTUATOR, way_back.popleft()[1])
        if magnet.settled:
            assert autopilot == (1.0 if on else -1.0)
        command = magnet.due(now)
        if command is not None and not lost_there:
            due = max([k + delay, *(due for due, _ in way_there)])
            way_there.append((due, command[1][1]))
    assert magnet.settled and autopilot == 1.0


class Wire(Memory):
    """Bridge's link and the stand-in's companion side, joined in memory, with real frames."""

    def __init__(self, parameters):
        super().__init__()
        sequence = OffboardSequence(OffboardParameters())
        self.link = OffboardLink(self, sequence, RateThrustParameters.of(load_description()))
        self.link.magnet = AutopilotMagnet(parameters)
        self.boot()
        self.ticks = 0

    def boot(self):
        self.autopilot, self.began = Autopilot(), getattr(self, "ticks", 0)
        self.companion, self.codec = Companion(self.autopilot), Codec(1, 1)
        self.framer = Framer(Codec(1, 1))

    def run(self, seconds):
        for _ in range(round(seconds / 0.02)):
            now, uptime = 0.02 * self.ticks, 0.02 * (self.ticks - self.began)
            self.link.poll(now)
            self.link.tick(now)
            sent, self.to_autopilot = self.to_autopilot, []
            for message in self.framer.datagram(b"".join(sent)):
                self.companion.handle(uptime, message)
            self.autopilot.update(uptime, np.zeros(3), np.array([0.0, 0.0, -9.81]))
            self.to_link += [self.codec.encode(m) for m in self.companion.tick(uptime)]
            self.ticks += 1


def test_the_stand_in_sets_its_actuator_and_answers():
    wire = Wire(ACTUATOR)
    wire.run(1.0)
    magnet = wire.link.magnet
    assert magnet.settled and wire.autopilot.actuators[1] == -1.0
    magnet.switch(0.02 * wire.ticks, True)
    wire.run(0.5)
    assert magnet.state is True and wire.autopilot.actuators[1] == 1.0
    assert np.isnan(wire.autopilot.actuators[[0, 2, 3, 4, 5]]).all()


def test_an_autopilot_that_rebooted_is_told_again():
    wire = Wire(GRIPPER)
    wire.link.magnet.switch(0.0, True)
    wire.run(5.0)
    assert wire.autopilot.gripper == {3: True}
    wire.boot()
    wire.run(6.0)
    assert wire.link.reboots == 1 and wire.autopilot.gripper == {3: True}
    assert wire.link.magnet.state is True


@pytest.mark.parametrize(
    ("values", "result"),
    [
        ((1, 1), MavResult.ACCEPTED),
        ((1, 2), MavResult.DENIED),
        ((math.nan, 1), MavResult.UNSUPPORTED),
    ],
)
def test_the_stand_ins_gripper(values, result):
    autopilot = Autopilot()
    parameters = (*map(float, values), 0.0, 0.0, 0.0, 0.0, 0.0)
    assert autopilot.command(0.0, MavCmd.DO_GRIPPER, parameters) == result
    assert autopilot.gripper == ({1: True} if result == MavResult.ACCEPTED else {})


def test_another_set_of_actuators_is_accepted_and_ignored_as_by_px4():
    autopilot = Autopilot()
    values = (1.0,) * 6
    assert autopilot.command(0.0, MavCmd.DO_SET_ACTUATOR, (*values, 1.0)) == MavResult.ACCEPTED
    assert np.isnan(autopilot.actuators).all()


def test_the_simulator_gets_the_actuators_in_the_last_six_controls():
    """HIL_ACTUATOR_CONTROLS: motors first; a plant behind the stand-in sees the magnet."""
    autopilot, sent = Autopilot(), []
    codec = Codec(1, 1)
    frame = codec.encode(
        mavlink2.MAVLink_hil_sensor_message(4000, *[0.0] * 2, -9.81, *[0.0] * 10, 0x3F, 0)
    )
    arrived = [frame, b""]
    simulator = SimpleNamespace(recv=lambda _: arrived.pop(0), sendall=sent.append)
    companion = SimpleNamespace(receive=lambda: [], send=lambda messages: None)
    autopilot.command(0.0, MavCmd.DO_SET_ACTUATOR, (math.nan, 0.5, *[math.nan] * 4, 0.0))
    Server(autopilot, simulator, companion).run()
    (answer,) = Framer(Codec(2, 1)).datagram(sent[0])
    expected = [0.0] * CONTROLS
    expected[CONTROLS - 5] = 0.5
    assert answer.controls == expected


@given(st.lists(st.booleans(), max_size=20), st.booleans())
def test_a_line_has_the_level_of_its_state(tmp_path_factory, states, active_low):
    file = tmp_path_factory.getbasetemp() / "line"
    line = FileLine(str(file), active_low=active_low)
    assert line.read() is False and file.read_text() == ("1" if active_low else "0")
    for on in states:
        line.set(on)
        assert line.read() is on
        assert file.read_text() == str(int(on is not active_low))


def test_the_driver_switches_once_and_reads_back(tmp_path):
    file = tmp_path / "line"
    driver = MagnetDriver(FileLine(str(file)))
    for desired in (False, False, True, True):
        driver.update(desired)
        assert driver.state is desired and driver.problem == ""
    assert driver.switched == 2
    file.write_text("0")  # something else pulls the line
    driver.update(True)
    assert driver.state is False
    assert driver.problem == "the line is off although it was switched on"
    driver.update(True)
    assert driver.state is True and driver.problem == ""
    file.unlink()
    driver.update(True)
    assert driver.state is None and driver.problem == "the line is lost: No such file or directory"
    driver.end(False)


def test_a_line_of_ones_own_is_chosen_by_its_kind(monkeypatch, tmp_path):
    class Relay(lines.Line):
        def __init__(self, chip, number, active_low):
            self.opened, self.on = (chip, number, active_low), False

        def set(self, on):
            self.on = on

        def read(self):
            return self.on

        def close(self):
            pass

    monkeypatch.setitem(lines.LINES, "relay", Relay)
    given = lines.LineParameters(chip="relay:/dev/ttyUSB3", line=2, active_low=True)
    line = lines.open_line(given)
    assert line.opened == ("/dev/ttyUSB3", 2, True)
    driver = MagnetDriver(line)
    driver.update(True)
    assert driver.state is True and driver.switched == 1
    driver.end(False)
    assert line.on is False
    simulated = lines.open_line(lines.LineParameters(chip=f"simulated:{tmp_path}/line"))
    assert type(simulated) is FileLine
    with pytest.raises(MagnetError, match="chip: /no/line: No such file or directory"):
        lines.open_line(lines.LineParameters(chip="simulated:/no/line"))


class Chip:
    """What gpiod gives for a requested line."""

    def __init__(self):
        self.values, self.released = {}, False

    def set_value(self, number, value):
        self.values[number] = value

    def get_value(self, number):
        return self.values[number]

    def release(self):
        self.released = True


def test_gpiod_is_asked_for_an_output_that_is_off(monkeypatch):
    pytest.importorskip("gpiod")
    asked, chip = {}, Chip()

    def request(device, consumer, config):
        asked.update(device=device, consumer=consumer, **{"config": config})
        return chip

    monkeypatch.setattr(lines.gpiod, "request_lines", request)
    line = GpioLine("/dev/gpiochip4", 17, True)
    settings = asked["config"][17]
    assert asked["device"] == "/dev/gpiochip4" and asked["consumer"] == "uam magnet"
    assert settings.direction is lines.Direction.OUTPUT and settings.active_low
    assert settings.output_value is lines.Value.INACTIVE
    line.set(True)
    assert line.read() is True and chip.values == {17: lines.Value.ACTIVE}
    line.set(False)
    assert line.read() is False
    line.close()
    assert chip.released


@pytest.mark.parametrize(
    ("chip", "reason"),
    [
        ("/dev/gpiochip_none", "chip: /dev/gpiochip_none does not exist; `gpiodetect` lists them"),
        ("/dev/null", "line: 17 of /dev/null: "),
    ],
)
def test_a_line_that_cannot_be_used_is_refused_in_one_line(chip, reason):
    pytest.importorskip("gpiod")
    with pytest.raises(MagnetError, match=reason) as refused:
        GpioLine(chip, 17, False)
    assert "\n" not in str(refused.value)

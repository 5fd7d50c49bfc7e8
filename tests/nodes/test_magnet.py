"""The magnet over real ROS: the node of a GPIO line, and the bridge with the autopilot's output."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Bool

from uam_control.offboard.modes import MavCmd
from uam_msgs_py.messages import topics

MODULE, NAME = "uam_sim_bridge.nodes.magnet_driver", "magnet_driver"


def arguments(file, **values):
    values = {"chip": f"simulated:{file}"} | values
    return ["--ros-args", *(w for k, v in values.items() for w in ("-p", f"{k}:={v}"))]


def health(reports, name=NAME):
    found = [s for m in reports for s in m.status if s.name == name]
    return found[-1] if found else DiagnosticStatus()


def commanding(probe, publisher, on, condition, what):
    """Publish the command at each look until `condition()`."""

    def look():
        publisher.publish(Bool(data=on))
        return condition()

    probe.until(look, what)


def test_the_line_follows_the_commands_and_its_state_is_fed_back(start, probe, tmp_path):
    file = tmp_path / "line"
    command = probe.publisher(topics.MAGNET)
    states, reports = probe.collect(topics.MAGNET_STATE), probe.collect(topics.DIAGNOSTICS)
    node = start(MODULE, *arguments(file))
    probe.until(lambda: states and not states[-1].data, "the state at the start")
    assert file.read_text() == "0"
    for on in (True, False, True):
        commanding(probe, command, on, lambda on=on: states[-1].data is on, f"state {on}")
        assert file.read_text() == str(int(on))
    commanding(probe, command, True, lambda: health(reports).message == "magnet on", "health: on")
    file.unlink()
    node.until_logged("the line is lost: No such file or directory")
    commanding(
        probe, command, True, lambda: health(reports).level == DiagnosticStatus.ERROR, "an error"
    )
    file.write_text("0")
    commanding(probe, command, True, lambda: file.read_text() == "1", "the line to be back")
    assert node.interrupt() == 0
    assert file.read_text() == "0"  # magnet_at_exit: release
    assert "Traceback" not in node.output


def test_lost_commands_release_and_the_exit_holds_where_stated(start, probe, tmp_path):
    file = tmp_path / "line"
    command, states = probe.publisher(topics.MAGNET), probe.collect(topics.MAGNET_STATE)
    values = {"magnet_when_stale": "release", "magnet_stale_after": 0.3, "magnet_at_exit": "hold"}
    node = start(MODULE, *arguments(file, active_low="true", **values))
    commanding(probe, command, True, lambda: states and states[-1].data, "on")
    node.until_logged("magnet off: commands are lost")
    probe.until(lambda: not states[-1].data, "off")
    assert file.read_text() == "1"  # active low
    commanding(probe, command, True, lambda: states[-1].data, "on again")
    assert node.interrupt() == 0 and file.read_text() == "0"


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"chip": "/dev/gpiochip_none"}, "chip: /dev/gpiochip_none does not exist"),
        ({"chip": "simulated:/no/such/folder/line"}, "chip: /no/such/folder/line: No such file"),
        ({"magnet_at_exit": "explode"}, "magnet_at_exit: 'explode' is not one of release, hold"),
        ({"line": "-1"}, "line: -1 is outside 0 to 1023"),
        ({"chip": "/dev/gpiochip_none", "no_such": "1"}, "no_such: unknown; allowed: "),
    ],
)
def test_wrong_values_are_refused_in_one_line(start, tmp_path, values, complaint):
    node = start(MODULE, *arguments(tmp_path / "line", **values))
    assert node.process.wait(60) == 2
    assert complaint in node.output and node.output.count("\n") == 1, node.output


def test_the_bridge_switches_the_autopilots_output_until_it_is_acknowledged(make_rig, probe):
    command = probe.publisher(topics.MAGNET)
    states, reports = probe.collect(topics.MAGNET_STATE), probe.collect(topics.DIAGNOSTICS)
    rig = make_rig("-p", "magnet:=actuator", "-p", "magnet_output:=1", "-p", "magnet_off:=0.0")
    probe.until_connected("mavlink_bridge", [command], [topics.MAGNET_STATE])

    def ticking(on, condition, what):
        def tick():
            command.publish(Bool(data=on))
            rig.tick()
            return condition()

        probe.until(tick, what)

    ticking(False, lambda: states and not states[-1].data, "off acknowledged")
    assert rig.autopilot.actuators[0] == 0.0 and math.isnan(rig.autopilot.actuators[1])
    ticking(True, lambda: states[-1].data, "on acknowledged")
    assert rig.autopilot.actuators[0] == 1.0

    def reported():
        values = {pair.key: pair.value for pair in health(reports, "mavlink_bridge").values}
        return values.get("magnet") == "True"

    ticking(True, reported, "the state in the diagnostics")
    # the autopilot no longer hears the command: it is repeated, and the state is not claimed
    handle, sent = rig.companion.handle, []

    def deaf(time, message):
        if message.get_type() == "COMMAND_LONG" and message.command == MavCmd.DO_SET_ACTUATOR:
            sent.append(message)
        else:
            handle(time, message)

    rig.companion.handle = deaf
    ticking(
        False,
        lambda: "does not answer" in health(reports, "mavlink_bridge").message,
        "silence to be said",
    )
    assert len(sent) >= 5 and states[-1].data is True
    rig.companion.handle = handle
    ticking(False, lambda: not states[-1].data, "off acknowledged")
    ticking(True, lambda: states[-1].data, "on acknowledged")
    # at its end the bridge releases the payload
    for _ in range(2):
        rig.node.process.send_signal(2)
    probe.until(lambda: (rig.receive(), rig.autopilot.actuators[0] == 0.0)[1], "the release")
    assert rig.node.process.wait(60) == 0 and "Traceback" not in rig.node.output

"""The checklist over real ROS: a vehicle whose sensors the test publishes, in a person's hands."""

import json
import math
import re
from functools import partial

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from held_vehicle import PERIOD, HeldVehicle, Wiring, axis_vector
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import BatteryState
from std_srvs.srv import SetBool, Trigger

from uam_control.coordinates import arm_coordinates
from uam_control.settings.preflight_check import PreflightCheck
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import preflight_message, read_checks
from uam_msgs_py.messages.convert import ImuWriter, JointStateWriter, PoseWriter, SetpointWriter
from uam_msgs_py.messages.parameter_comparison import ParameterComparison
from uam_msgs_py.messages.status import AutopilotState, ChecklistState, RadioState

MODULE = "uam_lab.preflight.checklist_node"
JOINTS = arm_coordinates(2)
NODES = "mission,mavlink_bridge,recorder,state_estimator"
# the test publishes slower than a vehicle does, and its computer has no governor to set
OPTIONS = {
    "nodes": NODES,
    "imu_rate": 0.05,
    "joint_rate": 0.05,
    "mocap_rate": 20.0,
    "disk": 0.01,
    "clock_synchronised": "false",
    "performance_governor": "false",
    "room_margin": 0.0,
    "still_angle": 0.09,
}


GREEN = PreflightCheck("mocap", "0 s", "at most 0.1 s", True)


class Hands:
    """Publishes the sensors of a held vehicle, and does what the checklist asks."""

    def __init__(self, probe, start, wiring=None, **options):
        self.probe, self.vehicle = probe, HeldVehicle(wiring)
        self.battery, self.killed, self.left = 0.9, False, ""
        self.reports = probe.collect(topics.CHECKLIST)
        self.sensors = {
            topic: probe.publisher(topic)
            for topic in (topics.IMU, topics.JOINTS, topics.MOCAP, topics.SETPOINT)
        }
        self.states = {
            topic: probe.publisher(topic)
            for topic in (
                topics.AUTOPILOT_STATE,
                topics.AUTOPILOT_BATTERY,
                topics.PREFLIGHT,
                topics.DIAGNOSTICS,
            )
        }
        self.writers = ImuWriter(), JointStateWriter(JOINTS), PoseWriter(), SetpointWriter()
        given = [w for k, v in (OPTIONS | options).items() for w in ("-p", f"{k}:={v}")]
        self.node = start(MODULE, "--ros-args", *given)
        probe.until(
            lambda: all(p.get_subscription_count() for p in self.sensors.values()), "the checklist"
        )
        self._due = 0.0
        self.switched = []
        node = probe.node
        node.create_service(GetParameters, "mission/get_parameters", self._fence)
        for kind, name in (
            (SetBool, "arm_driver/release"),
            (SetBool, "mission/magnet"),
            (Trigger, "arm_controller/reset_adaptation"),
        ):
            node.create_service(kind, name, partial(self._note, name))

    def _note(self, name, request, response):
        """Answer for a node that the checklist switches."""
        self.switched.append((name, getattr(request, "data", None)))
        response.success = True
        return response

    @staticmethod
    def _fence(request, response):
        """Answer for the mission."""
        sides = {"geofence_low": [-2.0, -2.0, -0.5], "geofence_high": [2.0, 2.0, 2.0]}
        response.values = [
            ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=sides[n])
            for n in request.names
        ]
        return response

    def tick(self):
        """Publish the sensors of one sample, and the states once a second."""
        sample = self.vehicle.sample()
        stamp = round(sample.time * 1e9)
        imu, joints, pose, setpoint = self.writers
        joints.position[:], joints.velocity[:] = sample.joints, 0.0
        out = self.sensors
        out[topics.JOINTS].publish(joints.stamped(stamp))
        out[topics.MOCAP].publish(pose.fill(stamp, sample.position, sample.attitude))
        out[topics.SETPOINT].publish(setpoint.fill(stamp, sample.commanded, 0.0))
        out[topics.IMU].publish(imu.fill(stamp, sample.rate, sample.force))
        if sample.time >= self._due:
            self._due = sample.time + 0.5
            self._publish_states(stamp)

    def _publish_states(self, stamp):
        state = AutopilotState(True, "HOLD", False).to_message(stamp)
        radio = RadioState(self.killed, "yes").to_message(stamp)
        read = ParameterComparison(2, 2, True).to_status()
        state.status = [*state.status, *radio.status, read]
        self.states[topics.AUTOPILOT_STATE].publish(state)
        self.states[topics.AUTOPILOT_BATTERY].publish(BatteryState(percentage=self.battery))
        self.states[topics.PREFLIGHT].publish(preflight_message(stamp, [GREEN]))
        array = DiagnosticArray()
        for name in NODES.split(","):
            if name != self.left:
                age = KeyValue(key="pose age at arrival, mean [ms]", value="12.0")
                array.status.append(DiagnosticStatus(name=name, message="running", values=[age]))
        self.states[topics.DIAGNOSTICS].publish(array)

    @property
    def state(self):
        return (
            ChecklistState.from_message(self.reports[-1])[1] if self.reports else ChecklistState()
        )

    @property
    def items(self):
        return {one.name: one for one in read_checks(self.reports[-1])} if self.reports else {}

    def until(self, condition, what):
        """Publish until `condition()`."""

        def ticked():
            self.tick()
            return condition()

        try:
            self.probe.until(ticked, what)
        except AssertionError as error:
            found = "; ".join(f"{name}: {one.value}" for name, one in self.items.items())
            raise AssertionError(f"{error}; {self.state}; {found}") from None

    def until_step(self, name):
        self.until(lambda: self.state.step == name, f"step {name}")

    def go(self, seconds, **target):
        """Move to `target`, see HeldVehicle.go; the node polls 50 times a second."""
        vehicle, count = self.vehicle, max(1, round(seconds / PERIOD))
        begin = {name: getattr(vehicle, name).copy() for name in target}
        for i in range(count):
            part = 0.5 - 0.5 * math.cos(math.pi * (i + 1) / count)
            for name, end in target.items():
                setattr(vehicle, name, begin[name] + part * (np.asarray(end) - begin[name]))
            self.tick()
            self.probe.until(iter((False, True)).__next__, "one look")

    def call(self, name):
        answer = self.probe.call(Trigger, f"checklist/{name}", Trigger.Request())
        return answer.success, answer.message

    def swing(self, name, **targets):
        """Do a motion: each target is kept until the checklist asks for the next, then back.

        It ends where the checklist asks for another step, or the step has failed.
        """
        self.until_step(name)
        self.until_asked(lambda words: words != "Hold the vehicle level and at rest.")
        begin = {key: getattr(self.vehicle, key).copy() for key in targets}
        for values in zip(*targets.values(), strict=True):
            before = self.state.instruction
            self.go(0.6, **dict(zip(targets, values, strict=True)))
            self.until_asked(lambda words, before=before: words != before)
        self.go(0.6, **begin)
        self.until(lambda: self.state.step != name or self.state.failed, f"{name} to end")

    def killed_long_enough(self):
        """Return whether the kill switch has been seen engaged for a second and more."""
        found = re.match(r"engaged for ([0-9.]+) s$", self.state.seen)
        return found is not None and float(found[1]) >= 1.0

    def until_asked(self, condition):
        """Publish until `condition(instruction)`, or the step has failed."""
        self.until(
            lambda: condition(self.state.instruction) or self.state.failed, "another instruction"
        )


@pytest.mark.long
def test_all_steps_pass_and_are_recorded(probe, start, tmp_path):
    file = tmp_path / "checklist.json"
    hands = Hands(probe, start, record=file)
    assert hands.call("confirm")[1].startswith("refused: no step is waiting; open: ")
    hands.until(lambda: hands.state.step == "hands_on", "the automatic items")
    assert hands.call("confirm") == (True, "hands_on confirmed")
    hands.until_step("tilt_roll")
    assert hands.state.commands
    passes = "refused: tilt_roll passes by what the sensors see, not by a confirmation"
    assert hands.call("confirm") == (False, passes)
    for axis, name in enumerate(("tilt_roll", "tilt_pitch")):
        hands.swing(name, turn=[axis_vector(axis, 0.3), axis_vector(axis, -0.3)])
    hands.swing("yaw_turn", turn=[axis_vector(2, 0.5)])
    place = hands.vehicle.position
    hands.swing("move_forward", position=[place + [0.4, 0.0, 0.0]])
    hands.swing("lift", position=[place + [0.0, 0.0, 0.3]])
    rest = hands.vehicle.joints
    hands.swing("joint:alpha_1", joints=[rest + [0.3, 0.0]])
    hands.swing("joint:alpha_2", joints=[rest + [0.0, 0.3]])
    for name in ("magnet_on", "magnet_off"):  # nobody reports its state
        hands.until(
            lambda name=name: (hands.state.step, hands.state.needs) == (name, "confirm"), name
        )
        assert hands.call("confirm")[0]
    hands.until_step("kill_switch")
    hands.killed = True
    hands.until(hands.killed_long_enough, "the kill switch")
    hands.killed = False
    hands.until_step("clear")
    assert not hands.state.passed
    assert hands.call("confirm")[0]
    hands.until(lambda: hands.state.passed, "the permission")
    assert hands.state.failing == ""
    # in this order at each service; calls to different services may overtake each other
    of_each = {name: [] for name, _ in hands.switched}
    for name, value in hands.switched:
        of_each[name].append(value)
    assert of_each == {
        "arm_driver/release": [True, False],
        "arm_controller/reset_adaptation": [None],
        "mission/magnet": [True, False],
    }

    def permitted():
        recorded.update(json.loads(file.read_text()))
        return recorded["passed"] and not recorded["failing"]

    # a test that had no processor for a second has lost the permission: it comes back
    recorded = {}
    hands.until(permitted, "the record of the permission")
    items = {one["name"]: one for one in recorded["items"]}
    assert items["clear"]["confirmed_by_person"] and not items["tilt_roll"]["confirmed_by_person"]
    assert "gyro against mocap" in items["tilt_roll"]["value"]
    assert items["tilt_roll"]["time"] and items["tilt_roll"]["tries"] == 1

    # An automatic item that fails takes the permission back. Others may fail for a moment: a test
    # that had no processor for a second has sent no sensors.
    hands.left = "recorder"
    hands.until(lambda: hands.state.failing == "nodes", "the permission to be taken back")
    assert not hands.state.passed
    assert "recorder: silent for " in hands.items["nodes"].value
    hands.left = ""
    hands.until(lambda: hands.state.passed, "the permission to come back")
    assert hands.node.interrupt() == 0
    assert "Traceback" not in hands.node.output


def test_a_reversed_gyro_is_not_passed(probe, start):
    hands = Hands(probe, start, Wiring(gyro=-1.0), rest_time=1.5)  # longer than by default
    hands.until_step("hands_on")
    hands.call("confirm")
    hands.swing("tilt_roll", turn=[axis_vector(0, 0.3), axis_vector(0, -0.3)])
    assert hands.state.step == "tilt_roll" and hands.state.failed
    assert hands.items["tilt_roll"].value.startswith("gyro against mocap: ")
    assert "tilt_roll" in hands.state.failing
    assert hands.call("repeat") == (True, "tilt_roll begins again")
    hands.until(lambda: not hands.state.failed, "the step to begin again")


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"tilt": 2.0}, "tilt: 2.0 is outside 0.1 to 0.8 rad"),
        ({"room_low": "[0.0, 0.0, 0.0]"}, "room_low, room_high: give both corners or none"),
        ({"tilts": 0.2}, "tilts: unknown"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(start, options, complaint):
    given = [w for k, v in options.items() for w in ("-p", f"{k}:={v}")]
    node = start(MODULE, "--ros-args", *given)
    assert node.process.wait(60.0) == 2
    lines = node.output.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith(f"checklist: {complaint}")

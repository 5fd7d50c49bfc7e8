"""The person of a rehearsal passes the guided steps of the checklist; wrong wiring does not.

The checklist's own objects look at the plant through the emulated devices, without pace and ROS.
"""

from __future__ import annotations

import numpy as np
import pytest
from free_port import free_port
from longer import longer

from uam_control.maths.rotations import matrix_from_quaternion
from uam_control.vehicle import load_description
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters
from uam_lab.preflight.checklist.guided import guided
from uam_lab.preflight.checklist.observation import GyroIntegral, Sample
from uam_lab.preflight.checklist.step import CONFIRM, Situation, StepState
from uam_sim_bridge.devices.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.devices.mocap.frame import BodyPose
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.schedule import timed
from uam_sim_bridge.laboratory.laboratory import Laboratory
from uam_sim_bridge.laboratory.laboratory_parameters import LaboratoryParameters
from uam_sim_bridge.laboratory.person import Person
from uam_sim_bridge.laboratory.set_up import RoomBody, mistaken_room
from uam_sim_bridge.plant import Vehicle

VEHICLE = load_description()
CHAIN = load_chain(hardware_file("s500_lab"), VEHICLE)
CALIBRATED = calibration.load("motive_y_up")
EVERY = 5  # [ticks] between two samples
PATIENCE = 60.0  # [s] of simulation for a step
GAIN = 4.0  # [1/s] body rates commanded against a turn


class Rehearsed:
    """The guided list on a laboratory with mistakes of the set-up."""

    def __init__(self, folder, *mistakes):
        wiring = Schedule(tuple(timed({**m, "at": "start"}, {}, "test") for m in mistakes))
        places = {"folder": str(folder), "magnet_line": str(folder / "magnet")}
        parameters = LaboratoryParameters(mocap_port=0, hil_port=free_port(), **places)
        self.lab = Laboratory(Vehicle.of(VEHICLE), parameters, CHAIN, CALIBRATED, wiring)
        (self._body,) = mistaken_room([RoomBody("uam", CALIBRATED)], wiring)
        self.person = Person(VEHICLE.joint_names, self.lab.folded)
        self.steps = guided(VEHICLE.joint_names, ChecklistParameters())
        self._gyro, self._level = GyroIntegral(), None

    def sample(self):
        """One tick of the laboratory; return what the nodes of the vehicle see."""
        lab = self.lab
        samples, truth = lab.sense(1.8e9 + lab.plant.time)
        step = next((one.name for one in self.steps if one.state is not StepState.PASSED), "")
        lab.grip = self.person.update(lab.plant.time, step, truth.state[0])
        lab.step(np.zeros(4), truth)
        time, rate, force = samples.hil
        self._gyro.add(time, rate)
        at, (x, y, z, w) = self._body.seen(truth.state[0, :3], truth.quaternion)
        position, attitude = CALIBRATED.convert(BodyPose(np.array(at), np.array([w, x, y, z])))
        self._level = attitude if self._level is None else self._level
        matrix = matrix_from_quaternion(self._level).T @ matrix_from_quaternion(attitude)
        skew = 0.5 * (matrix - matrix.T)
        against = -GAIN * np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        return Sample(
            *(time, position, attitude, self._gyro.value.copy(), force, rate),
            *(self.joints(), against),
        )

    def joints(self):
        """The joint angles as the driver reads them."""
        found = []
        for described in CHAIN.servos:
            servo = next((one for one in self.lab.servos if one.id == described.id), None)
            if servo is None:
                return np.full(len(CHAIN.servos), np.nan)
            servo.read(0, 1)
            found.append(described.angle(servo.get("Present Position")))
        return np.array(found)

    def until_stuck(self, *chosen):
        """Do the steps, or those chosen; return the first that does not pass, None if all do."""
        self.steps = [one for one in self.steps if not chosen or one.name in chosen]
        for step in self.steps:
            step.begin(self.lab.plant.time)
            end = self.lab.plant.time + PATIENCE
            while step.state is not StepState.PASSED:
                for _ in range(EVERY):
                    sample = self.sample()
                step.update(Situation(self.lab.plant.time, sample, step.magnet, False))
                if step.needs == CONFIRM and self.person.wishes_to_confirm:
                    step.confirm(self.lab.plant.time)
                if step.state is StepState.FAILED or self.lab.plant.time > end:
                    return step
        return None


@pytest.fixture
def rehearsed(tmp_path):
    made = []

    def make(*mistakes):
        made.append(Rehearsed(tmp_path, *mistakes))
        return made[-1]

    yield make
    for one in made:
        one.lab.close()


@pytest.mark.long
def test_all_steps_pass_with_the_right_wiring(rehearsed):
    rig = rehearsed()
    stuck = rig.until_stuck()
    assert stuck is None, (stuck.name, stuck.value, stuck.seen)
    assert rig.person.done[0] == "hands_on" and rig.person.done[-1] == "clear"
    place = rig.lab.plant.truth().state[0, :3]
    assert place == pytest.approx([0.0, 0.0, place[2]], abs=0.03)


@pytest.mark.parametrize(
    ("mistake", "step", "reason"),
    [
        ({"fault": "mocap_turned", "turn": 90.0}, "tilt_roll", "swapped?"),
        ({"fault": "direction_reversed", "joint": 1}, "joint:alpha_1", "reversed?"),
        *(
            longer(*case)
            for case in (
                ({"fault": "mocap_axes"}, "tilt_pitch", "swapped?"),
                ({"fault": "mocap_turned", "turn": 180.0}, "tilt_roll", "reversed?"),
                ({"fault": "direction_reversed", "joint": 2}, "joint:alpha_2", "reversed?"),
                ({"fault": "joints_swapped"}, "joint:alpha_1", "swapped?"),
            )
        ),
    ],
)
def test_wrong_wiring_is_found_by_hand(rehearsed, mistake, step, reason):
    stuck = rehearsed(mistake).until_stuck("hands_on", step)
    assert stuck is not None and stuck.name == step, stuck and (stuck.name, stuck.value)
    assert reason in stuck.value

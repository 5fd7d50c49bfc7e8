"""The library's options and errors, and flights of the direct engine."""

import numpy as np
import pytest

from uam_control.settings.parameter_file import ProfileError
from uam_lab import Flight, FlightError, NotInTime
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.flights.library.history import KEPT, History
from uam_lab.flights.observer import FlightStatus, Observer
from uam_lab.flights.ros import node_arguments
from uam_lab.records.results.result_folder import ResultFolderError
from uam_sim_bridge.faults import FaultError


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"scenari": "hover"}, "scenari: unknown, did you mean scenario?"),
        ({"parameters": {"pilot": {}}}, "unknown node 'pilot'; there are: position_controller"),
        ({"parameters": {"mission": 3}}, "parameters of mission: name → value expected"),
        ({"parameters": {"mission": {"scenario": "hover"}}}, "follows from the other options"),
        ({"parameters": {"scene": {"frame_rate": 5.0}}, "engine": "direct"}, "has no scene"),
        ({"remappings": {"goal_pose": "goal"}, "engine": "direct"}, "has no topics"),
        ({"remappings": {"goal_pose": ""}}, "two names"),
        ({"remappings": {"mission:uam/state": "x"}}, "two names"),
        ({"remappings": {"pilot": {"a": "b"}}}, "unknown node 'pilot'"),
        ({"remappings": {"mission": {"/uam/state": "x"}}}, "uam/state of mission alone would cut"),
        ({"remappings": {"scene": {"/diagnostics": "x"}}}, "diagnostics of scene alone would cut"),
        ({"remappings": {"uam/state": "uam/reference"}}, "that is the topic uam/reference"),
        ({"remappings": {"uam/state": "x", "/imu/data": "/x"}}, "that is the topic uam/state"),
        ({"remappings": {"mission": {"goal_pose": "path"}}}, "that is the topic path"),
        ({"imu": "mine"}, "imu: 'mine' is not one of topic, autopilot"),
        ({"imu": "autopilot", "autopilot": "udp:127.0.0.1:14580"}, "needs --clock realtime"),
        ({"without": ["mission=my planner"]}, "'my planner' is no name of a node"),
        ({"without": ["scene=mine"]}, "unknown node to fly without 'scene'"),
        ({"without": "scene=mine"}, "unknown node to fly without 'scene'"),
        ({"faults": [3]}, "faults: 3 is no text; allowed: SPEC|FILE"),
        ({"controller": ["modular"]}, "controller: '['modular']' is not one of modular"),
        ({"profile": 3}, "profile: 3 is no text; allowed: NAME|FILE"),
        ({"profile": ["s500", 3]}, "profile: 3 is no text; allowed: NAME|FILE"),
        ({"out": 5}, "out: 5 is no text; allowed: DIR"),
        ({"seed": 1.5}, "seed: 1.5 is no integer; allowed: 0 to 2147483647"),
        ({"seed": True}, "seed: True is no integer"),
        ({"instance": "a"}, "instance: 'a' is no integer; allowed: 0 to "),
        ({"payload_mass": "heavy"}, "payload_mass: 'heavy' is not numeric; allowed: 0 to 5 kg"),
        ({"observer": 3}, "observer: an Observer expected, got 3"),
        ({"vehicle_changes": 3}, "vehicle_changes: name → value expected, got 3"),
        ({"vehicle_changes": {"air.nosuch": [1]}}, "unknown entry 'air.nosuch'; air has: drag, "),
        ({"vehicle_changes": {"nosuch": 1}}, "unknown entry 'nosuch'; the vehicle has: "),
        ({"vehicle_changes": {"air.gust.x": 1}}, "'air.gust.x'; air.gust has: nothing, it is a v"),
        ({"vehicle_changes": {"air.wind": [1.0]}}, "air.wind: a list of 3 numbers expected, got ["),
        ({"vehicle_changes": {"air.wind": "x"}}, "air.wind: a list of 3 numbers expected, got 'x'"),
        ({"vehicle_changes": {"air.wind": [1, 2, np.nan]}}, "air.wind: a list of 3 numbers"),
        ({"vehicle_changes": {"air.gust": [1.0]}}, "air.gust: a number expected, got [1.0]"),
        (
            {"vehicle_changes": {"rotors.moment_ratio": 0.02}},
            "rotors.moment_ratio: the plant does not read it, give a vehicle file; it reads "
            "rotors.thrust_coefficient, ",
        ),
        ({"vehicle_changes": {"mass": 3.0}}, "mass: the plant does not read it, give a vehicle"),
        ({"vehicle_changes": {"rotors": {}}}, "rotors: one of its entries, layout, radius, "),
        ({"vehicle_changes": {"air.gust": -1.0}}, "vehicle_changes: air.gust: -1 is below 0"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options, why):
    with pytest.raises(SettingsError) as refused:
        Flight(**options)
    assert why in str(refused.value) and "\n" not in str(refused.value)


def test_one_text_is_a_list_of_one_and_numbers_may_be_numpys():
    made = Flight(
        without="mission=mine",
        faults="imu_dropout@1+1",
        plant_preset="laboratory",
        effects="joint_gear=off",
        seed=np.int64(3),
        vehicle_changes={"air.wind": np.array([1.0, 0.0, 0.0]), "air.gust": np.float64(0.5)},
    ).settings
    assert made.foreign == ("mission",) and made.own_names == {"mission": "mine"}
    assert len(made.faults.faults) == 1 and made.seed == 3
    assert "joint_gear" not in made.vehicle_changes["effects"]
    assert made.vehicle_changes["air.wind"] == [1.0, 0.0, 0.0]
    assert made.vehicle_changes["air.gust"] == 0.5


@pytest.mark.parametrize("fault", ["imu_stamps@1", "imu_dropout@1+1", "imu_bias@1:unit=companion"])
def test_faults_of_an_imu_that_is_not_used_are_refused(fault):
    Flight(faults=[fault])
    with pytest.raises(FaultError, match="the estimator has the autopilot's"):
        Flight(faults=[fault], imu="autopilot")


def test_a_parameter_is_checked_like_a_profile():
    with pytest.raises(ProfileError, match="position_controller: lambda_1"):
        Flight(parameters={"position_controller": {"lambda_1": [-1.0, 1.0, 1.0]}})


def test_parameters_replace_single_values_of_the_profile():
    plain = Flight().settings
    changed = Flight(
        parameters={
            "position_controller": {"lambda_1": np.array([1.0, 2.0, 3.0])},
            "mavlink_bridge": {"setpoint": "attitude"},
            "scene": {"frame_rate": 5.0},
        }
    ).settings
    before, after = (s.profile.sets["position_controller"] for s in (plain, changed))
    assert after.lambda_1 == (1.0, 2.0, 3.0) and after.lambda_2 == before.lambda_2
    assert changed.profile.sets["arm_controller"] == plain.profile.sets["arm_controller"]
    assert changed.profile.bridge()["setpoint"] == "attitude"
    assert changed.profile.name == plain.profile.name
    assert changed.parameters == {"scene": {"frame_rate": 5.0}}


def test_topics_may_be_remapped_for_every_node_and_others_for_one():
    every = {"uam/state": "estimate", "uam/reference": "uam/state_desired"}
    given = {**every, "mission": {"goal_pose": "goal"}}
    found = Flight(remappings=given).settings.remappings
    assert found == {"": every, "mission": {"goal_pose": "goal"}}


def test_an_own_node_may_have_a_name_of_its_own():
    settings = Flight(without=["mission=my_planner", "arm_controller", "scene"]).settings
    assert settings.foreign == ("mission", "arm_controller")
    assert settings.own_names == {"mission": "my_planner"}
    assert node_arguments.publishers(settings) == "mujoco_sim=mujoco_sim,mission=my_planner"


def test_a_flight_of_the_direct_engine(tmp_path, capfd):
    flight = Flight(scenario="hover", engine="direct", out=tmp_path)
    with pytest.raises(FlightError, match="not launched"):
        flight.wait()
    with flight:
        for act in (lambda: flight.wait_for("land"), flight.hold, lambda: flight.node("planner")):
            with pytest.raises(FlightError, match="needs engine='ros'"):
                act()
        with pytest.raises(NotInTime):
            flight.wait(0.0)
        result = flight.wait()
    assert result.completed and not flight.running and flight.domain is None
    frame = pytest.importorskip("pandas") and result.frame()
    assert len(frame) == len(result["time"]) and set(frame["phase"]) >= {"waiting", "landed"}
    assert np.array_equal(frame["error.x"], result["error.x"])
    assert capfd.readouterr() == ("", "")
    with pytest.raises(ResultFolderError, match="already contains a flight"):
        Flight(scenario="hover", engine="direct", out=tmp_path).launch()


def test_two_flights_of_the_direct_engine_at_once_are_those_of_single_ones(tmp_path):
    def options(name):
        return {"scenario": "hover", "engine": "direct", "out": tmp_path / name, "seed": 5}

    with Flight(**options("a")) as a, Flight(**options("b")) as b:
        first, second = a.wait(), b.wait()
    assert np.array_equal(first.series.values, second.series.values, equal_nan=True)


def status(phase: str) -> FlightStatus:
    return FlightStatus(phase, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def test_a_status_is_found_once_and_the_newest_again():
    history = History(Observer())

    def found(phase):
        return history.found(lambda one: one.phase == phase)

    assert found("pick") is None
    for phase in ("approach", "pick", "carry"):
        history.update(status(phase))
    assert found("pick").phase == "pick"
    assert found("approach") is None and found("carry").phase == "carry"
    assert found("carry").phase == "carry", "it is the newest"
    history.update(status("place"))
    assert found("carry") is None and found("place").phase == "place"
    history.update(status("carry"))
    history.update(status("land"))
    history.forget()
    assert found("carry") is None and found("land").phase == "land"


def test_a_flight_of_many_hours_keeps_its_newest_statuses():
    history = History(Observer())
    for number in range(3 * KEPT):
        history.update(status(str(number)))
    assert len(history.statuses) == KEPT
    first = history.found(lambda one: True)
    assert first.phase == str(2 * KEPT), "of those that are kept"
    assert history.found(lambda one: True).phase == str(2 * KEPT + 1)
    history.forget()
    assert history.found(lambda one: True).phase == str(3 * KEPT - 1)
    history.update(status("land"))
    assert history.found(lambda one: one.phase == "land") is history.statuses[-1]

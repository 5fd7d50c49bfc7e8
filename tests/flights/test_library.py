"""Flights from Python: `uam_lab.Flight`."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from uam_lab import (
    CommandRefused,
    Flight,
    FlightEnded,
    FlightError,
    FlightFailed,
    NotInTime,
    Observer,
)
from uam_lab.flights.ros import node_arguments
from uam_sim_bridge.faults import FaultError


class Notes(Observer):
    """Notes what it receives."""

    def __init__(self):
        self.lines, self.phases = [], []

    def message(self, text):
        self.lines.append(text)

    def update(self, status):
        self.phases.append(status.phase)


def test_commands_parameters_and_phases_of_a_flight(tmp_path, capfd):
    notes = Notes()
    given = {"scenario": "hover", "out": tmp_path / "out", "without": ["scene"], "fused": True}
    given["remappings"] = {"uam/state": "estimate", "imu/data": "imu", "uam/mission/status": "told"}
    limit = {"mission": {"takeoff_delay": 1.0}}
    with Flight(auto_start=False, parameters=limit, observer=notes, **given) as flight:
        with pytest.raises(NotInTime, match="'hover': not within 0.5 s"):
            flight.wait_for("hover", 0.5)
        with pytest.raises(FlightError, match="no result before the end"):
            _ = flight.result
        with pytest.raises(FlightError, match="flies once"):
            flight.launch()
        assert flight.start() == "arming"
        assert flight.wait_for("hover", 60.0).state == "flying"
        flight.hold()  # first: the hover of the scenario lasts seconds only
        held = flight.wait_for("holding", 30.0)
        assert held.cause == "hold by command"
        old, new = flight.set_parameters("position_controller", lambda_1=np.full(3, 2.0))[
            "position_controller"
        ]["lambda_1"]
        assert new == [2.0] * 3 != old
        with pytest.raises(CommandRefused, match=r"lambda_1: .* is outside"):
            flight.set_parameters("position_controller", lambda_1=[-2.0, 2.0, 2.0])
        with pytest.raises(CommandRefused, match="nonsense: unknown"):
            flight.set_parameters("mission", nonsense=1.0)
        with pytest.raises(CommandRefused, match="not while holding"):
            flight.start()
        flight.resume()
        result = flight.wait()
        with pytest.raises(FlightEnded, match="mission completed"):
            flight.land()
        with pytest.raises(FlightEnded, match="ended before 'aborted'"):
            flight.wait_for("aborted")
    assert result.completed and result.reason == "" and flight.result is result
    assert {"take-off", "hover", "hold", "land"} <= set(notes.phases)
    assert notes.lines == flight.messages
    held = result.phase() == "hold"
    assert held.any() and np.abs(result["error.z"][held]).max() < 0.1
    assert result.units["error.z"] == "m"
    assert (result.folder / "log.mcap").exists()
    assert capfd.readouterr() == ("", "")


@pytest.mark.long
def test_several_at_once_with_asyncio(short_scenario, tmp_path):
    async def one(seed):
        out = tmp_path / str(seed)
        async with Flight(scenario=short_scenario, seed=seed, out=out) as flight:
            await flight.wait_for_async("hover", 200.0)
            return flight.domain, await flight.wait_async()

    async def both():
        return await asyncio.gather(one(1), one(2))

    (domain, first), (other, second) = asyncio.run(both())
    assert domain != other and first.completed and second.completed
    assert not np.array_equal(first["estimate.x"], second["estimate.x"])


@pytest.mark.long
def test_a_block_that_is_left_stops_its_flight(long_scenario, tmp_path):
    with Flight(scenario=long_scenario, out=tmp_path) as flight:
        flight.wait_for("take-off", 60.0)
    assert not flight.running and not flight.result.completed
    assert flight.result.outcome.interrupted and len(flight.result["time"]) > 10


def test_a_failure_is_an_exception_with_its_reason(short_scenario, tmp_path, monkeypatch):
    monkeypatch.setattr(node_arguments, "START_TIMEOUT", 0.5)
    flight = Flight(scenario=short_scenario, out=tmp_path, fused=True)
    apart = {"mujoco_sim": {"imu/data": "nowhere"}}  # the control never gets its input
    flight.settings = replace(flight.settings, remappings=apart)
    with pytest.raises(FlightFailed, match="no progress for 0.5 s") as failed, flight:
        flight.wait()
    assert failed.value.result is flight.result and not flight.result.completed
    text = "\n".join(flight.messages)
    assert text.count("processes in ROS domain") == 2, "it is started once more"
    assert "no progress for 0.5 s" in text and "starting again" in text
    with pytest.raises(FlightError, match="nothing was recorded"):
        _ = flight.result["time"]


@pytest.mark.slow
def test_a_fault_is_injected_in_flight(tmp_path):
    with Flight(scenario="hover", out=tmp_path, without=["scene"]) as flight:
        flight.wait_for("hover", 60.0)
        for fault, why in (
            ({"fault": "motor_loss"}, "plan a fault of the plant by option faults"),
            ({"fault": "node_kill", "node": "scene"}, "does not start scene"),
            ({"fault": "earthquake"}, "earthquake"),
        ):
            with pytest.raises(FaultError, match=why):
                flight.inject(**fault)
        flight.inject("node_kill", node="arm_controller")
        result = flight.wait()
    (fault,) = result.outcome.faults
    assert fault["fault"] == "node_kill" and fault["begin_s"] >= 3.0
    assert any("arm_controller was killed by SIGKILL; restarted" in m for m in flight.messages)

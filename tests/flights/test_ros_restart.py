"""A controller is killed in flight: it is restarted, and the flight continues or lands.

Slow, and on an idle machine: how long the restart takes is wall time, in lockstep too.
"""

import json

import pytest
import yaml
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from whole_flight import assert_nothing_left

from uam_control.settings.configuration import path
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.node_environment import transport_environment
from uam_lab.records.rebuild import rebuild
from uam_msgs_py.node.wiring import ARM, ATTITUDE, POSITION


def states(flight):
    figures = json.loads((flight.out / "metrics.json").read_text())
    return figures, [(one["to"], one["cause"]) for one in figures["transitions"]]


@pytest.mark.slow
@pytest.mark.parametrize("victim", [POSITION, ATTITUDE, ARM])
def test_a_killed_controller_is_started_again_and_the_flight_goes_on(fly, victim):
    flight = fly("--scenario", "hover", "--fault", f"node_kill@hover+0.5:node={victim}")
    assert flight.wait() == 0, flight.said + flight.complained
    assert f"{victim} was killed by SIGKILL; restarted" in flight.said
    figures, passed = states(flight)
    assert figures["mission_completed"]
    held = any(state == "holding" for state, _ in passed)  # or it was back before that
    assert held == (("flying", "the controller is back") in passed)
    assert max(figures["max"]["position_m"]) < 1.5
    assert_nothing_left(flight, [])


@pytest.mark.slow
def test_a_controller_that_is_back_has_what_was_changed_in_flight(fly):
    flight = fly("--scenario", "hover", "--fault", f"node_kill@hover+1:node={POSITION}")
    flight.until(lambda: "ROS domain" in flight.said, "started")
    domain = int(flight.said.split("ROS domain ")[1].split(",")[0])
    with Guest("tuner", transport_environment(), domain) as guest:

        def called(kind, service, **request):
            """The response; requested again each second, because a killed node sends none."""
            client, answers = guest.node.create_client(kind, f"/{POSITION}/{service}"), []

            def answered():
                answers.append(client.call_async(kind.Request(**request)))
                executor.spin_until_future_complete(answers[-1], timeout_sec=1.0)
                return answers[-1].done()

            flight.until(lambda: client.service_is_ready() and answered(), service)
            return answers[-1].result()

        executor = SingleThreadedExecutor(context=guest.context)
        executor.add_node(guest.node)
        requested = [Parameter("tilt_max", value=0.3).to_parameter_msg()]
        (result,) = called(SetParameters, "set_parameters", parameters=requested).results
        assert result.successful, result.reason
        flight.until(lambda: "; restarted" in flight.said, "the restart")
        (kept,) = called(GetParameters, "get_parameters", names=["tilt_max"]).values
    assert kept.double_value == 0.3
    assert flight.wait() == 0, flight.said + flight.complained


@pytest.mark.slow
def test_the_policy_may_be_to_land(fly, tmp_path):
    flight = fly(
        "--scenario",
        "hover",
        "--fault",
        f"node_kill@hover+0.5:node={ARM}",
        "--profile",
        str(landing_profile(tmp_path)),
    )
    assert flight.wait() == 1
    _, passed = states(flight)
    assert passed[-2:] == [("landing", "the controller is back"), ("disarmed", "touchdown")]
    again = rebuild(flight.out, tmp_path / "again")
    assert [(one["to"], one["cause"]) for one in again["transitions"]] == passed


def landing_profile(folder):
    profile = yaml.safe_load(path("profiles/s500.yaml").read_text())
    quick = {"after_restart": "land", "controller_age_hold": 0.05, "hold_after": 0.0}
    profile["mission"]["ros__parameters"] |= quick  # it may be back soon
    file = folder / "landing.yaml"
    file.write_text(yaml.safe_dump(profile))
    return file

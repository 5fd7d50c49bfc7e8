"""What goes out, whatever comes: the map's, idle, the level hold's or nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.frames import swap_body, swap_quaternion
from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_euler,
    quaternion_from_euler,
)
from uam_control.setpoints.level_hold import HoldParameters
from uam_control.setpoints.rate_thrust_map import RateThrustMap, RateThrustParameters
from uam_control.setpoints.setpoint_source import SetpointSource, Situation
from uam_control.setpoints.setpoint_types import SETPOINTS, SetpointParameters
from uam_control.setpoints.targets import ATTITUDE as ATTITUDE_TARGET
from uam_control.setpoints.thrust_curve import thrust_of_command
from uam_control.vehicle import GRAVITY

TICK = 0.004
FLYING = Situation(armed=True, landed=False, let_go=False)
LET_GO = FLYING._replace(let_go=True)
STANDING = Situation(armed=False, landed=True, let_go=False)
WEIGHT, REST = np.array([0.0, 0.0, 20.0]), np.zeros(3)
ENDLESS = np.full(3, math.inf)


def state_at(height: float = 0.0, roll: float = 0.0) -> np.ndarray:
    state = np.zeros((3, 8))
    state[0, 2], state[0, 3] = height, roll
    return state


ATTITUDE = np.array([[0.1, -0.2, 0.7], [0.0] * 3, [0.0] * 3])  # desired, in flight


def in_flight(
    message: list[str] | None = None, fresh: float = math.inf, setpoint: str = "rates"
) -> SetpointSource:
    """One that stood on the ground and hovers at 1 m; its last tick was at 1 s."""
    notes = [] if message is None else message
    source = SetpointSource(
        RateThrustMap(),
        HoldParameters(),
        SETPOINTS[setpoint],
        fresh,
        lambda text, _: notes.append(text),
    )
    state = state_at()
    source.note_state(0.0, state)
    assert source.commanded(0.0, state, False, WEIGHT, None, ATTITUDE, STANDING).thrust == 0.0
    state = state_at(1.0)
    for k in range(1, 251):
        source.note_state(TICK * k, state)
        sent = source.commanded(TICK * k, state, True, WEIGHT, REST, ATTITUDE, FLYING)
    assert sent.thrust > 0.3 and not source.hold.active
    return source


@pytest.mark.parametrize(
    ("flying", "tau_p", "tau_q", "situation"),
    [
        (True, WEIGHT * math.nan, REST, FLYING),
        (True, WEIGHT, ENDLESS, FLYING),
        (True, WEIGHT, None, FLYING),
        (False, WEIGHT, REST, FLYING),
        (False, WEIGHT, None, FLYING),  # idle, high above the start
        (True, WEIGHT, REST, LET_GO),
    ],
)
def test_what_is_not_good_in_flight_is_a_level_hold_and_then_nothing(
    flying, tau_p, tau_q, situation
):
    source, state = in_flight(), state_at(1.0, roll=0.1)
    held = HoldParameters().level_time if situation.let_go else HoldParameters().hold_time
    for k in range(round((held + 0.5) / TICK)):
        now = 1.0 + TICK * (k + 1)
        source.note_state(now, state)
        setpoint = source.commanded(now, state, flying, tau_p, tau_q, ATTITUDE, situation)
        if TICK * k < held - 0.1:
            assert setpoint.thrust > 0.3
            if situation.let_go:  # levelled by the autopilot, whose setpoints may be late
                assert setpoint.type_mask == ATTITUDE_TARGET
                np.testing.assert_allclose(setpoint.quaternion[[1, 2]], 0.0, atol=1e-9)
            else:
                assert setpoint.body_rates[0] < -0.5
    assert setpoint is None and source.hold.active


def test_the_reason_is_logged():
    message = []
    source = in_flight(message)
    source.commanded(1.004, state_at(1.0), True, WEIGHT * math.nan, REST, ATTITUDE, FLYING)
    source.without(9.0, FLYING)
    assert message == [
        "setpoint refused: tau_p.x is not finite",
        "no usable commands in flight: holding level",
        "no usable commands in flight: stream stopped, the failsafe acts",
    ]


def test_on_the_ground_everything_is_idle():
    source = SetpointSource(RateThrustMap(), HoldParameters())
    for situation in (STANDING, FLYING._replace(landed=True), STANDING._replace(let_go=True)):
        setpoint = source.without(1.0, situation)
        assert setpoint.thrust == 0.0 and not setpoint.body_rates.any()


def test_an_old_estimate_gives_way_to_what_the_motion_capture_saw_and_then_to_none():
    source = in_flight(fresh=0.15)
    source.note_pose(1.1, quaternion_from_euler(np.array([0.0, 0.2, 0.0])))
    rates = source.without(1.2, FLYING).body_rates
    assert rates[1] == pytest.approx(-1.2, rel=0.05) and rates[0] == 0.0
    rates = source.without(1.3, FLYING).body_rates
    assert rates[0] == 0.0 and abs(rates[1]) < 0.3  # what the integral has gathered


NUMBERS = st.floats(-1e3, 1e3) | st.sampled_from([math.nan, math.inf, -math.inf, 0.0])
VECTORS = st.builds(lambda *v: np.array(v), NUMBERS, NUMBERS, NUMBERS)


@st.composite
def ticks(draw):
    state = state_at(draw(NUMBERS))
    state[0, 3:6], state[1, :3], state[1, 3:6] = draw(VECTORS), draw(VECTORS), draw(VECTORS)
    commands = draw(st.booleans()), draw(VECTORS), draw(st.none() | VECTORS)
    situation = Situation(draw(st.booleans()), draw(st.booleans()), draw(st.booleans()))
    return draw(st.booleans()), state, commands, situation


@pytest.mark.filterwarnings("ignore:invalid value")  # of infinite velocities
@given(
    st.lists(ticks(), min_size=1, max_size=30),
    st.floats(0.001, 1.0),
    st.sampled_from(list(SETPOINTS)),
)
def test_whatever_comes_setpoints_are_finite_and_within_their_limits(sequence, step, kind):
    source, limit = in_flight(setpoint=kind), np.array(RateThrustParameters.rate_limit)
    for k, (reported, state, commands, situation) in enumerate(sequence):
        now = 1.0 + step * (k + 1)
        if reported:
            source.note_state(now, state)
            setpoint = source.commanded(now, state, *commands, ATTITUDE, situation)
        else:
            setpoint = source.without(now, situation)
        if setpoint is not None:
            assert np.all(np.abs(setpoint.rates) <= limit) and 0.0 <= setpoint.thrust <= 1.0
            assert not setpoint.refused()


def desired(target) -> np.ndarray:
    """Roll, pitch, yaw [rad, FLU in ENU] of an attitude setpoint."""
    assert target.type_mask == 7 and np.isnan(target.body_rates).all()
    return euler_from_quaternion(swap_quaternion(target.quaternion))


def test_a_setpoint_type_of_the_user_can_be_chosen(monkeypatch):
    monkeypatch.setitem(SETPOINTS, "mine", SETPOINTS["rates"])
    assert SetpointParameters.from_mapping({"setpoint": "mine"}).type is SETPOINTS["rates"]


def test_attitude_setpoints_are_the_position_laws_attitude_with_the_same_thrust():
    state = state_at(1.0)
    rates, attitude = in_flight(), in_flight(setpoint="attitude")
    sent = attitude.commanded(1.004, state, True, WEIGHT, REST, ATTITUDE, FLYING)
    assert desired(sent) == pytest.approx([0.1, -0.2, 0.7], abs=1e-12)
    other = rates.commanded(1.004, state, True, WEIGHT, REST, ATTITUDE, FLYING)
    assert other.type_mask == 128 and sent.thrust == other.thrust


def test_an_attitude_that_is_not_finite_is_refused_where_it_is_sent():
    message = []
    source = in_flight(message, setpoint="attitude")
    bad = ATTITUDE * math.nan
    held = source.commanded(1.004, state_at(1.0), True, WEIGHT, REST, bad, FLYING)
    reason = "quaternion.w is nan, not finite"
    assert message[0] == f"setpoint refused: {source.refused}" and source.refused == reason
    assert source.hold.active
    assert desired(held) == pytest.approx([0.0, 0.0, 0.7], abs=1e-12)
    assert (
        not in_flight().commanded(1.004, state_at(1.0), True, WEIGHT, REST, bad, FLYING).refused()
    )


def test_the_level_hold_of_attitude_setpoints_tilts_against_the_velocity():
    source = in_flight(setpoint="attitude")
    state = state_at(1.0, roll=0.3)
    state[1, 0], state[0, 5] = 0.5, math.pi / 2.0  # eastward, looking north: to its right
    source.note_state(1.004, state)
    held = source.without(1.004, FLYING)
    # 0.5 m/s^2 to the left is a roll of -0.5/g; the yaw is that of the last good command
    assert desired(held) == pytest.approx([-0.5 / 9.81, 0.0, 0.7], abs=1e-3)
    last = source.without(1.004 + HoldParameters().hold_time - 0.01, FLYING)
    assert desired(last) == pytest.approx([0.0, 0.0, 0.7], abs=1e-12)


def test_idle_attitude_setpoints_are_level_with_the_yaw_of_the_vehicle():
    source = SetpointSource(RateThrustMap(), HoldParameters(), SETPOINTS["attitude"])
    assert desired(source.without(0.0, STANDING)) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    state = state_at(roll=0.1)
    state[0, 5] = -1.2
    source.note_state(0.0, state)
    sent = source.without(0.0, STANDING)
    assert desired(sent) == pytest.approx([0.0, 0.0, -1.2], abs=1e-12) and sent.thrust == 0.0


RELEASED = FLYING._replace(released=True)


def pushed(state: np.ndarray, lift: float) -> np.ndarray:
    """Set the acceleration of a thrust of `lift` times the weight along the thrust axis."""
    axis = matrix_from_euler(state[0, 3:6])[:, 2]
    state[2, :3] = GRAVITY * (lift * axis - np.array([0.0, 0.0, 1.0]))
    return state


@pytest.mark.parametrize("kind", ["rates", "attitude"])
@pytest.mark.parametrize("flying", [True, False])
def test_a_released_vehicle_gets_its_own_attitude_rates_and_thrust(kind, flying):
    source, said = in_flight(setpoint=kind), []
    state = state_at(1.0)
    flown = source.commanded(1.004, state, True, WEIGHT, REST, ATTITUDE, FLYING).thrust
    for k in range(2000):  # longer than hold_time: the stream does not end
        now = 1.008 + TICK * k
        state[0, 3:6] = 0.3 * math.sin(now), 0.2 * math.cos(now), 0.5 + 0.1 * now
        state[1, 3:6] = 0.4 * math.cos(now), 0.5, -0.1
        source.note_state(now, pushed(state, 1.0 + 0.1 * math.sin(now)))
        torque = REST + 1 if flying else None
        sent = source.commanded(now, state, flying, 2 * WEIGHT, torque, ATTITUDE, RELEASED)
        assert not source.hold.active
        curve = source.map.curve
        newtons = thrust_of_command(sent.thrust, *curve) / thrust_of_command(flown, *curve)
        assert newtons == pytest.approx(1.0 + 0.1 * math.sin(now))
        if kind == "attitude":
            angles = euler_from_quaternion(swap_quaternion(sent.quaternion))
            np.testing.assert_allclose(angles, state[0, 3:6], atol=1e-9)
        else:
            np.testing.assert_allclose(swap_body(sent.rates), state[1, 3:6])
    assert said == []


@pytest.mark.parametrize("commands", [True, False])
def test_without_a_flight_before_there_is_no_stream_for_a_vehicle_in_the_air(commands):
    """A pilot flies a vehicle whose mission has not flown, or whose companion was restarted."""
    said: list[str] = []
    source = SetpointSource(
        RateThrustMap(), HoldParameters(), say=lambda text, _: said.append(text)
    )
    for height in (0.9, 0.91):  # this process saw it in the air only
        state = state_at(height)
        source.note_state(1.0, state)
        for situation in (RELEASED, FLYING._replace(landed=False)):
            sent = (
                source.commanded(1.0, state, False, WEIGHT, None, ATTITUDE, situation)
                if commands
                else source.without(1.0, situation)
            )
            assert sent is None
    assert any("OFFBOARD is not possible" in text for text in said)


@pytest.mark.parametrize(
    ("height", "lift", "part"),
    # one that stands would lift off, and its acceleration would ask for more
    [(1.0, 0.0, 0.5), (1.0, 5.0, 1.5), (0.02, 0.8, 0.8), (0.02, 1.0, 0.97), (0.02, 1.4, 0.97)],
)
def test_thrust_and_rates_of_a_released_vehicle_are_bounded(height, lift, part):
    source = in_flight()
    state = state_at(1.0)
    flown = source.commanded(1.004, state, True, WEIGHT, REST, ATTITUDE, FLYING).thrust
    state[0, 2] = height
    state[1, 3:6] = 9.0, -9.0, 1.0
    source.note_state(1.1, pushed(state, lift))
    sent = source.commanded(1.1, state, False, WEIGHT, None, ATTITUDE, RELEASED)
    np.testing.assert_array_equal(swap_body(sent.rates), [2.0, -2.0, 1.0])
    curve = source.map.curve
    newtons = thrust_of_command(sent.thrust, *curve) / thrust_of_command(flown, *curve)
    assert newtons == pytest.approx(part)


def test_without_commands_a_released_vehicle_gets_no_stream():
    """OFFBOARD would bring it back to a chain without controllers: the autopilot refuses it."""
    source, state = in_flight(), state_at(1.0)
    source.note_state(1.1, state)
    assert source.without(1.1, RELEASED) is None


def test_a_released_vehicle_without_a_known_attitude_gets_a_finite_setpoint():
    source, state = in_flight(setpoint="attitude"), state_at(1.0)
    state[0, 3] = math.nan
    source.note_state(1.1, state)
    sent = source.commanded(1.1, state, False, WEIGHT, None, ATTITUDE, RELEASED)
    assert not sent.refused() and sent.thrust > 0.3


def test_a_released_vehicle_on_the_ground_gets_the_idle_setpoint():
    source, state = in_flight(), state_at()
    source.note_state(1.1, state)
    assert source.without(1.1, RELEASED._replace(landed=True)).thrust == 0.0
    assert source.without(1.2, RELEASED._replace(armed=False)).thrust == 0.0


@pytest.mark.parametrize("height", [1.0, 0.1])
def test_until_the_mission_has_resumed_the_setpoint_stays(height):
    """Idle commands near the ground would otherwise be thrust 0 for a tick."""
    source, state = in_flight(), state_at(height)
    state[1, 3] = 1.0
    source.note_state(1.1, state)
    before = source.commanded(1.1, state, False, WEIGHT, None, ATTITUDE, RELEASED)
    for now in (1.104, 1.15, 1.29):
        source.note_state(now, state)
        sent = source.commanded(now, state, False, WEIGHT, None, ATTITUDE, FLYING)
        assert sent.thrust == before.thrust > 0.3
        decayed = 1.0 - (now - 1.1) / 0.2
        np.testing.assert_allclose(swap_body(sent.rates), [decayed, 0.0, 0.0], atol=1e-12)
    ends = FLYING._replace(disarming=True)  # the mission does not resume: on the ground at once
    sent = source.commanded(1.29, state, False, WEIGHT, None, ATTITUDE, ends)
    assert (sent.thrust == 0.0) == (height < 0.3)
    state[1, 3] = 0.0
    sent = source.commanded(1.295, state, True, WEIGHT, REST, ATTITUDE, FLYING)
    assert sent.thrust == pytest.approx(before.thrust, rel=0.05)
    source.note_state(1.4, state)
    sent = source.commanded(1.4, state, False, WEIGHT, None, ATTITUDE, FLYING)
    assert source.hold.active == (height > 0.3) and (sent.thrust == 0.0) == (height < 0.3)

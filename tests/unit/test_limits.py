"""End of a flight that its mission does not end."""

from uam_control.mission.time_limit import DISARMED, FlightEnd, Settled


def test_a_flight_is_over_a_while_after_the_autopilot_has_disarmed():
    settled = Settled()
    assert not settled.over(100.0, armed=False), "it has not armed yet"
    assert not settled.over(101.0, armed=True)
    assert not settled.over(110.0, armed=False)
    assert not settled.over(114.9, armed=False)
    assert settled.over(115.0, armed=False)


def test_arming_again_continues_the_flight():
    settled = Settled()
    settled.over(0.0, armed=True)
    settled.over(1.0, armed=False)
    assert not settled.over(6.0, armed=True)
    assert not settled.over(7.0, armed=False)


def test_after_the_mission_the_flight_goes_on_until_the_autopilot_has_disarmed():
    assert Settled().after_mission(50.0, armed=False)
    settled = Settled()
    assert not settled.after_mission(50.0, armed=True)
    assert not settled.after_mission(58.0, armed=True)
    assert settled.after_mission(59.0, armed=False)
    assert settled.after_mission(65.0, armed=True), "15 s, and it lands no more"


def test_a_node_ends_its_flight_a_while_after_mission_and_landing():
    end, limit = FlightEnd(linger=2.0), (100.0, "limit")
    # the mission is done at 10 s, the autopilot disarms at 11 s
    told = {t: end.reason(t, t < 11.0, t >= 10.0, limit) for t in (9.0, 10.0, 11.0, 12.9, 13.0)}
    assert told == {9.0: "", 10.0: "", 11.0: "", 12.9: "", 13.0: "mission"}


def test_a_node_ends_a_flight_without_end():
    end = FlightEnd(linger=2.0)
    told = [end.reason(float(t), t < 3, False) for t in range(9)]
    assert told == [""] * 8 + [DISARMED], "5 s after it has disarmed"
    end = FlightEnd(linger=50.0)
    assert end.reason(99.0, True, False, (100.0, "limit")) == ""
    assert end.reason(100.0, True, False, (100.0, "limit")) == "limit"
    end.reason(70.0, False, True)
    assert end.reason(100.0, False, True, (100.0, "limit")) == "mission", "it was done before"

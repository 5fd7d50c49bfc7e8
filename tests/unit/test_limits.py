"""End of a flight that its mission does not end."""

from uam_control.mission.time_limit import Settled


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

"""End of a flight that its mission does not end."""

from uam_control.mission.time_limit import SETTLED, Settled


def test_a_flight_is_over_a_while_after_the_autopilot_has_disarmed():
    settled = Settled()
    assert not settled.over(100.0, armed=False), "it has not armed yet"
    assert not settled.over(101.0, armed=True)
    assert not settled.over(110.0, armed=False)
    assert not settled.over(110.0 + SETTLED - 0.1, armed=False)
    assert settled.over(110.0 + SETTLED, armed=False)


def test_arming_again_continues_the_flight():
    settled = Settled()
    settled.over(0.0, armed=True)
    settled.over(1.0, armed=False)
    assert not settled.over(1.0 + SETTLED, armed=True)
    assert not settled.over(2.0 + SETTLED, armed=False)

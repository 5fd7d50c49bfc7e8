"""The plant in lockstep does not wait for a node that is being restarted."""

from uam_sim_bridge.nodes.lockstep import Restart


def test_without_a_restart_it_waits():
    restart = Restart(10.0)
    restart.tick(complete=False)
    restart.look(0)
    assert not restart.going_on


def test_it_does_not_wait_until_all_have_answered_in_time_for_a_while():
    restart = Restart(10.0)
    restart.look(1)
    for complete in (False, *[True] * 24, False, *[True] * 24):
        restart.tick(complete)
        assert restart.going_on
    restart.tick(complete=True)
    assert not restart.going_on
    restart.look(1)
    assert not restart.going_on
    restart.look(2)
    assert restart.going_on


def test_it_waits_again_after_the_longest_restart():
    restart = Restart(0.0)
    restart.look(1)
    assert not restart.going_on

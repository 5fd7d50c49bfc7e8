"""What is lost while a real PX4 flies, and what PX4 and our end of the link then do.

The stand-in flies the same tests, so that both are known to behave alike.
"""

import pytest
from px4_at_hand import NO_PX4, installation
from rate_steps import flown_by

from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import CUSTOM_MODE_ENABLED, MavCmd, Mode
from uam_control.offboard.sequence import Phase
from uam_sim_bridge.mavlink.protocol.wire import Codec, mavlink2

AUTOPILOTS = [
    pytest.param(False, id="stand-in"),
    pytest.param(True, id="px4", marks=pytest.mark.skipif(installation() is None, reason=NO_PX4)),
]
GARBAGE = bytes(range(256)) * 4 + b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00half a frame"


@pytest.fixture(params=AUTOPILOTS)
def hovering(request):
    """A vehicle that hovers."""
    with flown_by(installation() if request.param else None) as flight:
        flight.take_off()
        yield flight


def test_a_short_gap_of_the_stream_is_nothing(hovering):
    hovering.mute(0.2)
    hovering.hover(1.0)
    assert hovering.modes_seen == {Mode.OFFBOARD} and hovering.height > 1.0


def test_a_long_gap_ends_in_the_failsafe_which_is_not_overridden(hovering):
    """PX4 v1.16.1 takes OFFBOARD again by itself, once setpoints come: nobody has left it."""
    hovering.mute(2.0)
    assert hovering.mode is not Mode.OFFBOARD
    hovering.hover(3.0)
    ends = (Mode.LAND, Phase.RELEASED), (Mode.OFFBOARD, Phase.FLYING)
    assert (hovering.mode, hovering.phase) in ends
    assert Mode.LAND in hovering.modes_seen and hovering.largest_tilt < 0.3


def test_the_stream_lost_for_good_ends_on_the_ground_disarmed(hovering):
    hovering.mute(25.0)
    assert not hovering.armed and hovering.on_ground
    assert hovering.hardest_touchdown < 1.5


def test_vision_lost_is_flown_on_with_body_rates(hovering):
    hovering.blind(3.0)
    assert hovering.mode is Mode.OFFBOARD and hovering.height > 1.0
    assert hovering.largest_tilt < 0.2


def test_garbage_on_the_link_changes_nothing(hovering):
    for _ in range(50):
        hovering.send_raw(GARBAGE)
        hovering.hover(0.02)
    assert hovering.modes_seen == {Mode.OFFBOARD} and hovering.height > 1.0


def test_another_mode_from_a_ground_station_stays(hovering):
    command = mavlink2.MAVLink_command_long_message(
        hovering.system,
        mavlink2.MAV_COMP_ID_AUTOPILOT1,
        MavCmd.DO_SET_MODE,
        0,
        CUSTOM_MODE_ENABLED,
        *FIRMWARES["px4"].mode_request(Mode.LAND)[1:],
        0,
        0,
        0,
        0,
    )
    hovering.send_raw(Codec(255, mavlink2.MAV_COMP_ID_MISSIONPLANNER).encode(command))
    hovering.hover(1.5)
    assert hovering.mode is Mode.LAND and hovering.phase is Phase.RELEASED
    assert hovering.largest_tilt < 0.3

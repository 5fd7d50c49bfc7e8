"""docs/hardware.md names parameters, defaults and periods of the code."""

from pathlib import Path

import pytest

from uam_control.offboard import autopilot_magnet
from uam_control.offboard.autopilot_magnet import AutopilotMagnetParameters
from uam_control.offboard.modes import MavCmd
from uam_sim_bridge.devices.magnet.lines import SwitchingParameters

PAGE = (Path(__file__).resolve().parents[2] / "docs/hardware.md").read_text()


@pytest.mark.parametrize("kind", [SwitchingParameters, AutopilotMagnetParameters])
def test_every_parameter_is_on_the_page(kind):
    for name in kind.specs():
        assert f"`{name}`" in PAGE, name


def test_defaults_and_periods_are_those_of_the_code():
    rules = SwitchingParameters()
    assert f"| `magnet_stale_after` | {rules.magnet_stale_after:g} s |" in PAGE
    assert f"| `magnet_when_stale` | `{rules.magnet_when_stale}` |" in PAGE
    assert f"| `magnet_at_exit` | `{rules.magnet_at_exit}` |" in PAGE
    assert f"every {autopilot_magnet.REPEAT:g} s until COMMAND_ACK" in PAGE
    assert f"MAV_CMD_DO_SET_ACTUATOR ({MavCmd.DO_SET_ACTUATOR:d})" in PAGE
    assert f"MAV_CMD_DO_GRIPPER ({MavCmd.DO_GRIPPER:d})" in PAGE

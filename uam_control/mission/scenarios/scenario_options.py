"""Options of a scenario, fixed for a flight."""

from dataclasses import dataclass

from uam_control.settings.parameter_set import ParameterSet, choice, number, switch

AS_SCENARIO, RETURN, LAND = "scenario", "return", "land"
SLOWEST = 20.0  # largest slowdown


@dataclass(frozen=True)
class ScenarioOptions(ParameterSet):
    """How a trajectory is reached, left and timed. A scenario without trajectory has own moves."""

    end: str = choice(
        AS_SCENARIO,
        "after the trajectory: return to the take-off point or land where it ends; scenario: as "
        "its file says, else return",
        (AS_SCENARIO, RETURN, LAND),
    )
    transit_speed: float = number(
        1.0, "largest speed on the way to the trajectory and back", "m/s", 0.05, 5.0
    )
    transit_acceleration: float = number(
        1.0, "largest acceleration there, and along a run-up", "m/s^2", 0.05, 5.0
    )
    transit_yaw_rate: float = number(0.8, "largest yaw rate there", "rad/s", 0.05, 3.0)
    transit_joint_rate: float = number(0.8, "largest joint rate there", "rad/s", 0.05, 3.0)
    slowdown: float = number(
        1.0, "factor by which the scenario takes longer than written", "1", 1.0, SLOWEST
    )
    retime: bool = switch(
        False, "slow a scenario that exceeds a limit down until it does not (before take-off)"
    )

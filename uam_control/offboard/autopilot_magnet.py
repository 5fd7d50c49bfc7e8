"""The magnet on an output of the autopilot: DO_SET_ACTUATOR or DO_GRIPPER until acknowledged.

PX4 v1.16 acknowledges every DO_SET_ACTUATOR: the answer says that the command arrived, not that an
output is assigned (`Peripheral via Actuator Set`). DO_GRIPPER is answered by PX4's payload
deliverer: in progress at once, accepted after PD_GRIPPER_TO; a request meanwhile is refused. With
PD_GRIPPER_TYPE -1 every one fails.
"""

import math
from collections import deque
from dataclasses import dataclass

from uam_control.offboard.modes import MavCmd, MavResult, result_word
from uam_control.settings.parameter_set import ParameterError, ParameterSet, choice, integer, number

NONE, ACTUATOR, GRIPPER = "none", "actuator", "gripper"
ACTUATORS = 6  # of one DO_SET_ACTUATOR
GRAB, RELEASE = 1.0, 0.0  # GRIPPER_ACTIONS
REPEAT = 0.2  # [s] between two requests without an answer
REFUSED_REPEAT = 1.0  # [s] after a refusal
PROGRESS_REPEAT = 3.0  # [s] after "in progress": PD_GRIPPER_TO of PX4 is 1 s
SILENT_AFTER = 5  # requests without an answer that are reported
LATEST = 1.0  # [s] an answer comes within this time, or it is lost


@dataclass(frozen=True)
class AutopilotMagnetParameters(ParameterSet):
    """Which output of the autopilot; it cannot change while the node runs."""

    magnet: str = choice(
        NONE,
        "magnet through the autopilot: none; actuator: MAV_CMD_DO_SET_ACTUATOR; gripper: "
        "MAV_CMD_DO_GRIPPER",
        (NONE, ACTUATOR, GRIPPER),
    )
    magnet_output: int = integer(
        1, "number of the actuator of the set, or of the gripper", 1, ACTUATORS
    )
    magnet_on: float = number(1.0, "value of the actuator for on", "1", -1.0, 1.0)
    magnet_off: float = number(-1.0, "value of the actuator for off", "1", -1.0, 1.0)

    def check_together(self) -> None:
        """Raise ParameterError if on and off are the same."""
        if self.magnet_on == self.magnet_off:
            raise ParameterError(
                f"magnet_on: {self.magnet_on:g} is also magnet_off; they must differ"
            )


class AutopilotMagnet:
    """Requests the desired state until the autopilot acknowledges it. Times [s] of the ticks."""

    def __init__(self, parameters: AutopilotMagnetParameters) -> None:
        self._parameters = parameters
        gripper = parameters.magnet == GRIPPER
        self._command = MavCmd.DO_GRIPPER if gripper else MavCmd.DO_SET_ACTUATOR
        self.requests = 0  # number of commands sent
        self._desired = False
        self.restart()

    def restart(self) -> None:
        """Forget what was acknowledged: the autopilot is new or has rebooted."""
        self.state: bool | None = None  # acknowledged, None while unknown
        self._due = -math.inf
        self._refusal = ""
        # A COMMAND_ACK has no number. Answers to requests of an earlier state may still come, at
        # most one for each of the last second; the one after those is for the present state.
        self._unanswered: deque[float] = deque()  # [s] when they were sent
        self._ignored = self._silent = 0

    def switch(self, time: float, on: bool) -> None:
        """Set the desired state at `time`."""
        if on == self._desired:
            return
        self._desired, self.state = on, None
        while self._unanswered and self._unanswered[0] < time - LATEST:
            self._unanswered.popleft()
        self._ignored, self._silent = len(self._unanswered), 0
        self._due, self._refusal = -math.inf, ""

    @property
    def settled(self) -> bool:
        """Whether the desired state is acknowledged."""
        return self.state is self._desired

    @property
    def problem(self) -> str:
        """Return one line about what is wrong, "" if nothing is."""
        word = "on" if self._desired else "off"
        if self._refusal:
            return f"magnet {word}: the autopilot says {self._refusal}"
        if self._silent >= SILENT_AFTER:
            return f"magnet {word}: the autopilot does not answer"
        return ""

    def due(self, time: float) -> tuple[MavCmd, tuple[float, ...]] | None:
        """Return the command to send at `time` and its seven parameters; None if none is due."""
        if self.settled or time < self._due:
            return None
        self._due = time + (REFUSED_REPEAT if self._refusal else REPEAT)
        self.requests += 1
        self._silent += 1
        self._unanswered.append(time)
        p, values = self._parameters, [math.nan] * ACTUATORS
        if p.magnet == GRIPPER:
            action = GRAB if self._desired else RELEASE
            return self._command, (float(p.magnet_output), action, 0.0, 0.0, 0.0, 0.0, 0.0)
        values[p.magnet_output - 1] = p.magnet_on if self._desired else p.magnet_off
        return self._command, (*values, 0.0)  # param7: index of the set

    def answer(self, time: float, command: int, result: int) -> bool:
        """Handle a COMMAND_ACK; False: it belongs to another command."""
        if command != self._command:
            return False
        if result == MavResult.IN_PROGRESS:  # the final answer follows
            self._due, self._silent = max(self._due, time + PROGRESS_REPEAT), 0
            return True
        if self._unanswered:
            self._unanswered.popleft()
        self._silent = 0
        if self._ignored:
            self._ignored -= 1
        elif result == MavResult.ACCEPTED:
            self.state, self._refusal = self._desired, ""
        elif not self.settled:
            self._refusal = result_word(result)
            self._due = time + REFUSED_REPEAT
        return True

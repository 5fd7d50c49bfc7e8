"""Services of the mission node: the commands that are accepted in flight.

| service | type | does |
|---|---|---|
| `~/start` | std_srvs/Trigger | arm and take off, if the pre-arm report is green |
| `~/hold` | std_srvs/Trigger | stop on the path and hold the position |
| `~/resume` | std_srvs/Trigger | continue on the path after a hold; regain a released vehicle |
| `~/land` | std_srvs/Trigger | stop on a fast path, descend vertically and disarm |
| `~/disarm` | std_srvs/Trigger | motors off: on the ground, or in failsafe |
| `~/magnet` | std_srvs/SetBool | on or off until the scenario switches it next |

The response contains the action of the next tick, or the reason why the command is refused.
"""

from functools import partial

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from uam_control.mission import Mission
from uam_control.supervision import OperatorCommand

COMMANDS = {
    command.name.lower(): command
    for command in OperatorCommand
    if command is not OperatorCommand.GOAL  # comes with a pose or trajectory, see planner_inputs
}
START, MAGNET = "start", "magnet"


def offer(node: Node, mission: Mission) -> None:
    """Create the services of `mission` in `node`; they run between two ticks."""

    def answer(
        what: str, response: Trigger.Response | SetBool.Response, result: tuple[bool, str]
    ) -> Trigger.Response | SetBool.Response:
        response.success, response.message = result
        node.get_logger().info(f"command {what}: {response.message}")
        return response

    def on_command(
        name: str, command: OperatorCommand, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        return answer(name, response, mission.request(command))

    def on_start(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return answer(START, response, mission.start())

    def on_magnet(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        what = f"{MAGNET} {'on' if request.data else 'off'}"
        return answer(what, response, mission.switch_magnet(request.data))

    for name, command in COMMANDS.items():
        node.create_service(Trigger, f"~/{name}", partial(on_command, name, command))
    node.create_service(Trigger, f"~/{START}", on_start)
    node.create_service(SetBool, f"~/{MAGNET}", on_magnet)

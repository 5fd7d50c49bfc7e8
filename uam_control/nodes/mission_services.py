"""Services of the mission node: the commands that are accepted in flight.

| service | type | does |
|---|---|---|
| `~/hold` | std_srvs/Trigger | stops on the path and waits there |
| `~/resume` | std_srvs/Trigger | goes on from there |
| `~/land` | std_srvs/Trigger | goes straight down and disarms |
| `~/disarm` | std_srvs/Trigger | motors off: on the ground, or in failsafe |
| `~/magnet` | std_srvs/SetBool | on or off until the scenario switches it next |

An answer says what will be done at the next tick, or why it is refused.
"""

from functools import partial

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from uam_control.mission import Mission
from uam_control.supervision import OperatorCommand

COMMANDS = {command.name.lower(): command for command in OperatorCommand}
MAGNET = "magnet"


def offer(node: Node, mission: Mission) -> None:
    """Have `node` offer the services, for `mission`; they are served between two ticks."""

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

    def on_magnet(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        what = f"{MAGNET} {'on' if request.data else 'off'}"
        return answer(what, response, mission.switch_magnet(request.data))

    for name, command in COMMANDS.items():
        node.create_service(Trigger, f"~/{name}", partial(on_command, name, command))
    node.create_service(SetBool, f"~/{MAGNET}", on_magnet)

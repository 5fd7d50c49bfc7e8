"""Answers service requests; an exception of a callback never ends the node.

rclpy's own callbacks raise too: ValueError for a parameter of an unknown type.
"""

from collections.abc import Callable, Coroutine

from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.service import Service
from std_srvs.srv import SetBool, Trigger


def answered(service: Service) -> bool:
    """Take one request and send the response; return whether there was one.

    If the callback raises, the response has what it filled in so far: without anything, that of
    our services and of set_parameters_atomically is a refusal.
    """
    try:
        request, header = service.handle.service_take_request(service.srv_type.Request)
    except Exception as error:  # bytes that are no request
        _tell(service, error)
        return True
    if header is None:
        return False
    response = service.srv_type.Response()
    try:
        response = service.callback(request, response)
    except Exception as error:
        _tell(service, error)
    service.send_response(response, header)
    return True


def _tell(service: Service, error: Exception) -> None:
    text = f"{service.service_name}: request refused: {type(error).__name__}: {error}"
    get_logger(service.logger_name).error(text)


def offer(
    node: Node, kind: type[Trigger | SetBool], name: str, act: Callable[..., tuple[bool, str]]
) -> None:
    """Offer a command as a service.

    act: returns whether it is done, and a text, which is logged, too; a SetBool passes its value.
    """
    said = name.removeprefix("~/")

    def answer(
        request: Trigger.Request | SetBool.Request, response: Trigger.Response | SetBool.Response
    ) -> Trigger.Response | SetBool.Response:
        asked = [request.data] if kind is SetBool else []
        response.success, response.message = act(*asked)
        words = " ".join([said, *("on" if one else "off" for one in asked)])
        node.get_logger().info(f"command {words}: {response.message}")
        return response

    node.create_service(kind, name, answer)


class ServingExecutor(SingleThreadedExecutor):
    """rclpy's, with services as in `answered`; their callbacks are no coroutines."""

    def _take_service(self, srv: Service) -> Callable[[], Coroutine[None, None, None]] | None:
        """Answer now: rclpy calls this when it executes the service."""
        answered(srv)
        return None

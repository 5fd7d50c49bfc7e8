"""Asynchronous service calls: a callback gets the response, or the reason of a failure."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from uam_control.settings.parameter_file import ROS_OWN
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.node_parameters import plain

PATIENCE = 3.0  # [s] of wall time for an answer

Answer = Callable[[Any, str], None]


class Services:
    """Service clients of one node. `look` calls the callbacks, in the thread of its caller."""

    def __init__(self, node: Node):
        self._node = node
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._open: list[tuple[Any, Any, float, Answer]] = []

    def client(self, kind: type, name: str) -> Any:
        """Return the client of the service `name`; create it if necessary."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        return self._clients[name]

    def publish(self, topic: Topic, message: Any) -> None:
        """Publish a message; the publisher is made at the first one that is asked for."""
        self.offer(topic).publish(message)

    def offer(self, topic: Topic) -> Any:
        """Return the publisher of a topic; create it if necessary."""
        if topic.name not in self._publishers:
            self._publishers[topic.name] = topic.outlet(self._node)
        return self._publishers[topic.name]

    def ready(self, kind: type, name: str) -> bool:
        """Return whether a node offers the service."""
        return self.client(kind, name).service_is_ready()

    def call(self, kind: type, name: str, request: Any, answer: Answer) -> None:
        """Call a service; `look` later calls answer(response, "") or answer(None, reason)."""
        client = self.client(kind, name)
        if not client.service_is_ready():
            answer(None, f"{name}: service not found")
            return
        end = time.monotonic() + PATIENCE
        self._open.append((client, client.call_async(request), end, answer))

    def look(self) -> None:
        """Call the callbacks of received responses and of expired requests."""
        now = time.monotonic()
        still, self._open = self._open, []
        for client, future, end, answer in still:
            if future.done():
                answer(future.result(), "")
            elif now > end:
                client.remove_pending_request(future)
                answer(None, f"{client.srv_name}: no response")
            else:
                self._open.append((client, future, end, answer))


class RemoteParameters:
    """Parameters of one node. `known` contains their descriptors after `load`."""

    def __init__(self, services: Services, node: str):
        self.node = node
        self.known: dict[str, ParameterDescriptor] = {}
        self.values: dict[str, Any] = {}
        self._services = services

    def _call(self, kind: type, service: str, request: Any, answer: Answer) -> None:
        self._services.call(kind, f"{self.node}/{service}", request, answer)

    @property
    def is_there(self) -> bool:
        return self._services.ready(ListParameters, f"{self.node}/list_parameters")

    def load(self, done: Callable[[str], None]) -> None:
        """Request descriptions and values; then call done(""), or done(reason) on failure."""

        def listed(response: ListParameters.Response | None, why: str) -> None:
            if why:
                done(why)
                return
            names = sorted(n for n in response.result.names if not n.startswith(ROS_OWN))
            request = DescribeParameters.Request(names=names)
            self._call(DescribeParameters, "describe_parameters", request, described)

        def described(response: DescribeParameters.Response | None, why: str) -> None:
            if why:
                done(why)
                return
            self.known = {one.name: one for one in response.descriptors}
            self.refresh(done)

        self._call(ListParameters, "list_parameters", ListParameters.Request(), listed)

    def refresh(self, done: Callable[[str], None]) -> None:
        """Request the values again; then call done(""), or done(reason) on failure."""
        names = list(self.known)

        def got(response: GetParameters.Response | None, why: str) -> None:
            if not why:
                for name, value in zip(names, response.values, strict=True):
                    self.values[name] = plain(value)
            done(why)

        self._call(GetParameters, "get_parameters", GetParameters.Request(names=names), got)

    def set(self, changes: Mapping[str, Any], done: Callable[[str], None]) -> None:
        """Request changes as a whole; then call done(""), or done(reason) if refused."""

        def answered(response: SetParametersAtomically.Response | None, why: str) -> None:
            if not why and not response.result.successful:
                why = response.result.reason or "refused without a reason"
            if not why:
                self.values.update(changes)
            done(why)

        messages = [Parameter(name, value=v).to_parameter_msg() for name, v in changes.items()]
        request = SetParametersAtomically.Request(parameters=messages)
        self._call(SetParametersAtomically, "set_parameters_atomically", request, answered)

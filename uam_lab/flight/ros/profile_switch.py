"""Gives a whole profile to nodes that fly: all of them take it, or none does.

First every node is asked whether it would accept (`~/check_parameters`, which changes nothing).
Only when all say yes do they get the values, each node all of its own at once and between two of
its ticks. Should one refuse even then, the others get their old values back.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from uam_control.profiles.profile import CONTROLLERS, NODES, Profile
from uam_msgs_py.node import wiring
from uam_msgs_py.node.node_parameters import plain
from uam_msgs_py.node.tunable import CHECK

PATIENCE = 10.0  # [s] of wall time for a node to be found, and to answer
AGAIN = 1.0  # [s] after which a request is repeated
APPLY = "set_parameters_atomically"

Values = dict[str, Any]


class SwitchRefused(ValueError):
    """The profile was not taken and the old values fly on; one line for each node that refused."""


class ProfileSwitch:
    """Talks to the nodes of one ROS domain through `node`."""

    def __init__(self, node: Node):
        self._node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def switch(self, profile: Profile) -> dict[str, dict[str, tuple[Any, Any]]]:
        """Have `profile` fly; return what changed: node → name → (old, new).

        Raises SwitchRefused, with nothing changed.
        """
        wanted = _wanted(profile)
        old = self._current(wanted)
        new = {
            node: {name: value for name, value in values.items() if value != old[node].get(name)}
            for node, values in wanted.items()
        }
        new = {node: values for node, values in new.items() if values}
        self._all_accept(self._ask(CHECK, new))
        answers = self._ask(APPLY, new)
        try:
            self._all_accept(answers)
        except SwitchRefused:
            taken = [node for node, reason in answers.items() if not reason]
            self._ask(APPLY, {n: {name: old[n][name] for name in new[n]} for n in taken})
            raise
        return {
            node: {name: (old[node][name], value) for name, value in values.items()}
            for node, values in new.items()
        }

    def _current(self, wanted: Mapping[str, Values]) -> dict[str, Values]:
        """What flies now of the `wanted` parameters; a node leaves out those that it has not."""
        listed = self._call(
            ListParameters, "list_parameters", {n: ListParameters.Request() for n in wanted}
        )
        names = {
            node: [name for name in values if name in listed[node].result.names]
            for node, values in wanted.items()
        }
        asked = {node: GetParameters.Request(names=own) for node, own in names.items()}
        found = self._call(GetParameters, "get_parameters", asked)
        current = {
            node: dict(zip(own, map(plain, found[node].values), strict=True))
            for node, own in names.items()
        }
        laws = {node: current[node].get("law") for node in CONTROLLERS}
        self._all_accept({
            node: f"the law {law} flies and cannot change to {wanted[node]['law']}"
            for node, law in laws.items() if law != wanted[node]["law"]
        })  # fmt: skip
        return current

    def _ask(self, service: str, changes: Mapping[str, Values]) -> dict[str, str]:
        """Ask every node for its changes as a whole; node → why it refuses, "" if it does not."""
        requests = {
            node: SetParametersAtomically.Request(
                parameters=[Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
            )
            for node, values in changes.items()
        }
        answers = self._call(SetParametersAtomically, service, requests)
        return {
            node: "" if answer.result.successful else answer.result.reason or "no reason given"
            for node, answer in answers.items()
        }

    @staticmethod
    def _all_accept(reasons: Mapping[str, str]) -> None:
        refused = [f"{node}: {reason}" for node, reason in reasons.items() if reason]
        if refused:
            raise SwitchRefused("\n".join(refused))

    def _call(self, kind: type, service: str, requests: Mapping[str, Any]) -> dict[str, Any]:
        """Call a service of several nodes at a time; node → response. Raises SwitchRefused."""
        clients = {node: self._node.create_client(kind, f"/{node}/{service}") for node in requests}
        try:
            self._until(lambda node: clients[node].service_is_ready(), clients, "is not there")
            calls = {node: _Call(clients[node], requests[node]) for node in clients}
            self._until(lambda node: calls[node].done(), calls, "does not answer")
            return {node: call.response for node, call in calls.items()}
        finally:
            for client in clients.values():
                self._node.destroy_client(client)

    def _until(self, done: Callable[[str], bool], nodes: Collection[str], complaint: str) -> None:
        end = time.monotonic() + PATIENCE
        while missing := [node for node in nodes if not done(node)]:
            if time.monotonic() > end:
                self._all_accept(dict.fromkeys(missing, complaint))
            self._executor.spin_once(timeout_sec=0.02)


class _Call:
    """A request, repeated while it is not answered: a node that has found the client's request but
    not its ear for the response answers to nobody. To be asked twice is the same as once here.
    """

    def __init__(self, client: Client, request: Any):
        self._client, self._request = client, request
        self._futures: list[Any] = []
        self._due = -math.inf
        self.response: Any = None

    def done(self) -> bool:
        """Whether there is a response; asks again when it is time to."""
        for future in self._futures:
            if future.done():
                self.response = future.result()
                return True
        now = time.monotonic()
        if now >= self._due:
            self._due = now + AGAIN
            self._futures.append(self._client.call_async(self._request))
        return False


def _wanted(profile: Profile) -> dict[str, Values]:
    """The parameters of every node that the profile has; for the bridge those that it names."""
    wanted = {node: profile.sets[node].to_mapping() for node in NODES}
    bridge = profile.bridge()
    return wanted | ({wiring.BRIDGE: bridge} if bridge else {})

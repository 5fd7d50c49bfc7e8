"""Changes parameters in flight, as a whole profile: all nodes apply them, or none.

First every node checks its values (`~/check_parameters`, without any change). If all accept, each
node receives its values in one request and applies them between two ticks. If a node still
refuses or does not answer, the others get their old values back.
"""

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
from uam_lab.flights.operator import NoFlight
from uam_msgs_py.node import wiring
from uam_msgs_py.node.node_parameters import plain
from uam_msgs_py.node.tunable import CHECK

PATIENCE = 10.0  # [s] wall time to find a service, and the same to receive its response
AGAIN = 1.0  # [s] after which a request is repeated
APPLY = "set_parameters_atomically"
NO_RESPONSE = "no response"
NOT_FOUND = "service not found"

Values = dict[str, Any]


class SwitchRefused(ValueError):
    """The profile was refused and the old values stay active; one line per refusing node."""


class SwitchIncomplete(SwitchRefused):
    """The profile was refused, and some nodes may have its values; one more line for each."""


class ProfileSwitch:
    """Client of the parameter services of one vehicle: of the nodes in the namespace of `node`."""

    def __init__(self, node: Node):
        self._node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def switch(self, profile: Profile) -> dict[str, dict[str, tuple[Any, Any]]]:
        """Activate `profile`; return the changes: node → name → (old, new).

        Raises SwitchRefused without any change, SwitchIncomplete; NoFlight if no node is there.
        """
        return self.change(_desired(profile))

    def change(self, desired: Mapping[str, Values]) -> dict[str, dict[str, tuple[Any, Any]]]:
        """Set parameters, node → name → value; otherwise as `switch`."""
        old = self._current(desired)
        new = {
            node: {name: value for name, value in values.items() if value != old[node].get(name)}
            for node, values in desired.items()
        }
        new = {node: values for node, values in new.items() if values}
        if len(new) > 1:
            self._all_accept(self._ask(CHECK, new))
        answers = self._ask(APPLY, new)
        try:
            self._all_accept(answers)
        except SwitchRefused as refused:
            # a silent node may have applied the values; it comes last, and each node is asked on
            # its own, so that it does not delay the others
            taken = [node for node, reason in answers.items() if not reason]
            taken += [node for node, reason in answers.items() if reason == NO_RESPONSE]
            kept: dict[str, str] = {}
            for node in taken:
                kept |= self._ask(APPLY, {node: {name: old[node][name] for name in new[node]}})
            lines = [f"{n}: may have the new values: {why}" for n, why in kept.items() if why]
            if lines:
                raise SwitchIncomplete("\n".join([str(refused), *lines])) from None
            raise
        return {
            node: {name: (old[node][name], value) for name, value in values.items()}
            for node, values in new.items()
        }

    def _current(self, desired: Mapping[str, Values]) -> dict[str, Values]:
        """Return the active values of the `desired` parameters that the nodes have."""
        listed, missing = self._call(
            ListParameters, "list_parameters", {n: ListParameters.Request() for n in desired}
        )
        if missing and all(missing.get(node) == NOT_FOUND for node in desired):
            nodes = ", ".join(map(self._node.resolve_service_name, desired))
            raise NoFlight.seen_by(self._node, f"no node {nodes}")
        self._all_accept(missing)
        names = {
            node: [name for name in values if name in listed[node].result.names]
            for node, values in desired.items()
        }
        requests = {node: GetParameters.Request(names=own) for node, own in names.items()}
        found, missing = self._call(GetParameters, "get_parameters", requests)
        self._all_accept(missing)
        current = {
            node: dict(zip(own, map(plain, found[node].values), strict=True))
            for node, own in names.items()
        }
        laws = {
            node: current[node].get("law") for node in CONTROLLERS if "law" in desired.get(node, ())
        }
        self._all_accept({
            node: f"the active law {law} cannot change to {desired[node]['law']} in flight"
            for node, law in laws.items() if law != desired[node]["law"]
        })  # fmt: skip
        return current

    def _ask(self, service: str, changes: Mapping[str, Values]) -> dict[str, str]:
        """Send each node its changes in one request; node → reason of refusal, "" if accepted."""
        requests = {
            node: SetParametersAtomically.Request(
                parameters=[Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
            )
            for node, values in changes.items()
        }
        answers, missing = self._call(SetParametersAtomically, service, requests)
        return missing | {
            node: "" if answer.result.successful else answer.result.reason or "no reason given"
            for node, answer in answers.items()
        }

    @staticmethod
    def _all_accept(reasons: Mapping[str, str]) -> None:
        refused = [f"{node}: {reason}" for node, reason in reasons.items() if reason]
        if refused:
            raise SwitchRefused("\n".join(refused))

    def _call(
        self, kind: type, service: str, requests: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, str]]:
        """Call a service of several nodes in parallel, or of none if one does not have it.

        Returns node → response, and node → complaint for those without one.
        """
        clients = {node: self._node.create_client(kind, f"{node}/{service}") for node in requests}
        try:
            missing = self._missing(lambda node: clients[node].service_is_ready(), clients)
            if missing:
                return {}, dict.fromkeys(missing, NOT_FOUND)
            calls = {node: _Call(clients[node], requests[node]) for node in clients}
            missing = self._missing(lambda node: calls[node].done(), calls)
            answers = {node: call.response for node, call in calls.items() if node not in missing}
            return answers, dict.fromkeys(missing, NO_RESPONSE)
        finally:
            for client in clients.values():
                self._node.destroy_client(client)

    def _missing(self, done: Callable[[str], bool], nodes: Collection[str]) -> list[str]:
        """Spin until every node is `done`; return those that are not after PATIENCE."""
        end = time.monotonic() + PATIENCE
        while (missing := [node for node in nodes if not done(node)]) and time.monotonic() <= end:
            self._executor.spin_once(timeout_sec=0.02)
        return missing


class _Call:
    """A request, repeated until a response arrives: during discovery a service may receive a
    request before it can reach the client with the response. The requests are idempotent."""

    def __init__(self, client: Client, request: Any):
        self._client, self._request = client, request
        self._futures: list[Any] = []
        self._due = -math.inf
        self.response: Any = None

    def done(self) -> bool:
        """Return whether there is a response; repeat the request every AGAIN seconds."""
        for future in self._futures:
            if future.done():
                self.response = future.result()
                return True
        now = time.monotonic()
        if now >= self._due:
            self._due = now + AGAIN
            self._futures.append(self._client.call_async(self._request))
        return False


def _desired(profile: Profile) -> dict[str, Values]:
    """Return the parameters of each node in the profile; for the bridge only the named ones."""
    desired = {node: profile.sets[node].to_mapping() for node in NODES}
    bridge = profile.bridge()
    return desired | ({wiring.BRIDGE: bridge} if bridge else {})

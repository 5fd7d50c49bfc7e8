"""An additional node in the ROS domain of a running flight, with its own ROS context."""

import os
import re
from collections.abc import Mapping, Sequence
from typing import Self

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from uam_control.settings.configuration import ConfigurationError
from uam_lab.flights.processes.child import borrowed

SECURITY = "ROS_SECURITY_ENABLE"
SOURCE = re.compile(r",? at /\S+:\d+|^failed to initialize rcl: ")  # of rcl's text, for its authors


class RosRefused(ConfigurationError):
    """ROS does not start with this environment or these remappings; one line with the reason."""


class Guest:
    """Context manager with `node` in the flight's ROS domain; the caller spins or polls it."""

    def __init__(
        self,
        name: str,
        environment: Mapping[str, str],
        domain: int | None = None,
        namespace: str = "",
        arguments: Sequence[str] = (),
    ):
        """environment: of the flight's processes; ROS reads some of its variables here too.

        domain: ROS domain, None for that of the environment; namespace: of the vehicle's nodes;
        arguments: of ROS, as remappings. Raises RosRefused.
        """
        with borrowed(environment):
            self.context = rclpy.Context()
            try:
                self.node = self._started(name, domain, namespace, arguments)
            except RCLError as error:
                rclpy.try_shutdown(context=self.context)
                raise RosRefused(_reason(error)) from None

    def _started(
        self, name: str, domain: int | None, namespace: str, arguments: Sequence[str]
    ) -> Node:
        rclpy.init(
            args=["--ros-args", "--disable-external-lib-logs", *arguments],
            context=self.context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        return Node(
            name,
            namespace=namespace,
            context=self.context,
            cli_args=["--ros-args", *arguments],
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )

    def close(self) -> None:
        """Destroy the node and its context."""
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception) -> None:
        self.close()


def _reason(error: RCLError) -> str:
    """Return the text for the user, while the environment is that of ROS."""
    text = SOURCE.sub("", " ".join(str(error).split())).rstrip(". ")
    secured = os.environ.get(SECURITY) == "true" and "SECURITY" in text.upper()
    hint = f"; {SECURITY} is true: unset it, or docs/interfaces.md" if secured else ""
    return f"ROS does not start: {text}{hint}"

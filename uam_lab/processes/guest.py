"""An additional node in the ROS domain of a running flight, with its own ROS context."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from uam_lab.processes.borrowed_environment import borrowed


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
        arguments: of ROS, as remappings.
        """
        with borrowed(environment):
            self.context = rclpy.Context()
            rclpy.init(
                args=["--ros-args", "--disable-external-lib-logs", *arguments],
                context=self.context,
                domain_id=domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            self.node = Node(
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

    def __enter__(self) -> Guest:
        return self

    def __exit__(self, *exception) -> None:
        self.close()

"""An additional node in the ROS domain of a running flight, with its own ROS context."""

from __future__ import annotations

import os
from collections.abc import Mapping

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


class Guest:
    """Context manager with `node` in the flight's ROS domain; the caller spins or polls it."""

    def __init__(
        self,
        name: str,
        environment: Mapping[str, str],
        domain: int | None = None,
        namespace: str = "",
    ):
        """environment: of the flight's processes; ROS reads some of its variables here too.

        domain: ROS domain, None for that of the environment; namespace: of the vehicle's nodes.
        """
        before = dict(os.environ)
        os.environ.update(environment)
        try:
            self.context = rclpy.Context()
            rclpy.init(
                args=["--ros-args", "--disable-external-lib-logs"],
                context=self.context,
                domain_id=domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            self.node = Node(
                name,
                namespace=namespace,
                context=self.context,
                use_global_arguments=False,
                start_parameter_services=False,
                enable_rosout=False,
            )
        finally:
            os.environ.clear()
            os.environ.update(before)

    def close(self) -> None:
        """Destroy the node and its context."""
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def __enter__(self) -> Guest:
        return self

    def __exit__(self, *exception) -> None:
        self.close()

"""A node beside a running flight, in a ROS context of its own, that nobody waits for."""

from __future__ import annotations

import os
from collections.abc import Mapping

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


class Guest:
    """`node` in the flight's ROS domain. A context manager; whoever uses it spins it or polls."""

    def __init__(self, name: str, environment: Mapping[str, str], domain: int | None = None):
        """environment: of the flight's processes, of which ROS reads some variables here too.

        domain: None for that of the environment.
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
                context=self.context,
                use_global_arguments=False,
                start_parameter_services=False,
                enable_rosout=False,
            )
        finally:
            os.environ.clear()
            os.environ.update(before)

    def close(self) -> None:
        """Leave the flight."""
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def __enter__(self) -> Guest:
        return self

    def __exit__(self, *exception) -> None:
        self.close()

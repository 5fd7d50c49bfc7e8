"""A device that may be absent when its driver starts: refused, or waited for."""

import time
from collections.abc import Callable
from typing import Generic, TypeVar

from uam_control.settings.process_parameters import DeviceWait
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.node_parameters import NodeParameters

PERIOD = 1.0  # [s] between two attempts

Device = TypeVar("Device")


class LateDevice(Generic[Device]):
    """Opens the device at the start, or at the attempt that succeeds."""

    def __init__(
        self, node: UamNode, make: Callable[[], Device], errors: tuple[type[Exception], ...]
    ) -> None:
        """make: opens the device; errors: what it raises without one. Raises them if not waiting.

        Declares the parameter `wait_for_device` of the node.
        """
        self.device: Device | None = None  # None: absent
        self.problem = "not opened yet"  # why it is absent, in one line; "" with a device
        self._node, self._make, self._errors = node, make, errors
        self._due = 0.0  # [s] time.monotonic() of the next attempt
        self.waits = NodeParameters(node, DeviceWait, read_only=True).current.wait_for_device

    def begin(self) -> None:
        """Without waiting, open the device; raises what `make` raises."""
        if not self.waits:
            self.device, self.problem = self._make(), ""

    def attempt(self) -> Device | None:
        """Return the device; try to open an absent one, at most once per PERIOD."""
        now = time.monotonic()
        if self.device is not None or now < self._due:
            return self.device
        before = self.problem
        try:
            self.device, self.problem = self._make(), ""
            self._node.get_logger().info("the device is open")
        except self._errors as error:
            self.problem = str(error)
            if self.problem != before:
                self._node.get_logger().warning(f"waiting for the device: {self.problem}")
        self._due = time.monotonic() + PERIOD
        return self.device

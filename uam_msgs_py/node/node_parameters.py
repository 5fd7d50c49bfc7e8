"""ROS parameters of a node from a ParameterSet: declared, checked as a whole, swapped at once.

A change is tried on a copy of the whole set. If the set as a whole may fly it is accepted and takes
effect between two control ticks; otherwise ROS gets the reason and the old values fly on.
"""

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    ParameterDescriptor,
    ParameterValue,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from uam_control.settings.parameter_set import Bound, Choice, ParameterError, ParameterSet, Switch

S = TypeVar("S", bound=ParameterSet)


def descriptor(
    spec: Bound | Choice | Switch, read_only: bool, axes: Sequence[str] = ()
) -> ParameterDescriptor:
    """Return what `ros2 param describe` shows: meaning, unit, range, and the order in a vector.

    axes: what the entries of a per-axis vector belong to.
    Typing is dynamic because people write `5` where a float is meant; the set checks types itself.
    """
    text = ParameterDescriptor(
        description=spec.description,
        dynamic_typing=True,
        read_only=read_only or getattr(spec, "fixed", False),
    )
    if isinstance(spec, Choice):
        text.additional_constraints = "one of: " + ", ".join(spec.choices)
    if isinstance(spec, Bound):
        text.description = f"{spec.description} [{spec.unit}]"
        each = "" if spec.length is None else "each "
        order = f"; {', '.join(axes)}" if spec.length == 0 and axes else ""
        text.additional_constraints = f"{each}{spec.low:g} to {spec.high:g} {spec.unit}{order}"
        if spec.length is None:
            text.floating_point_range = [
                FloatingPointRange(from_value=spec.low, to_value=spec.high, step=0.0)
            ]
    return text


class NodeParameters(Generic[S]):
    """The parameter set of one node, kept equal to its ROS parameters.

    `current` is the set that flies. `apply` is called with each accepted new set, from the thread
    that spins the node, hence between two ticks.
    """

    def __init__(
        self,
        node: Node,
        kind: type[S],
        axes: Sequence[str] = (),
        defaults: dict[str, Any] | None = None,
        apply: Callable[[S], None] | None = None,
        read_only: bool = False,
    ):
        """Declare all parameters of `kind`.

        axes: names of the entries of a per-axis vector. defaults: the values of the default
        profile, used for what the parameter file does not say, unless that file is complete by
        itself. read_only: fixed once the node runs. Raises ParameterError for values that must not
        fly.
        """
        self._axes = len(axes)
        self.apply = apply
        told = {name: value for name, value in given(node).items() if name in kind.specs()}
        base = {} if complete(kind, told) else dict(defaults or {})
        self.current = kind.from_mapping(base | told, self._axes)
        for name, spec in kind.specs().items():
            value = getattr(self.current, name)
            node.declare_parameter(
                name,
                list(value) if isinstance(value, tuple) else value,
                descriptor(spec, read_only, axes),
                ignore_override=True,
            )
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._swap)

    def _candidate(self, changes: list[Parameter]) -> S:
        known = self.current.specs()
        values = {name: getattr(self.current, name) for name in known}
        values |= {change.name: change.value for change in changes if change.name in known}
        return self.current.from_mapping(values, self._axes)

    def _check(self, changes: list[Parameter]) -> SetParametersResult:
        try:
            self._candidate(changes)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _swap(self, changes: list[Parameter]) -> None:
        new = self._candidate(changes)
        if new == self.current:
            return
        self.current = new
        if self.apply is not None:
            self.apply(new)


def given(node: Node) -> dict[str, Any]:
    """Return what the parameter file and the command line say, by name."""
    return {name: value.value for name, value in node._parameter_overrides.items()}


def plain(message: ParameterValue) -> Any:
    """The value of a parameter that a service told, as YAML has it: arrays as lists."""
    value = parameter_value_to_python(message)
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def complete(kind: type[ParameterSet], given: dict[str, Any]) -> bool:
    """Whether `given` holds every value that has no default of its own."""
    empty = [name for name in kind.specs() if getattr(kind, name, ()) == ()]
    return bool(given) and all(name in given for name in empty)


def refuse_unknown(node: Node) -> None:
    """Raise ParameterError for a value in the parameter file that no declared parameter takes."""
    own = ("use_sim_time", "qos_overrides.", "start_type_description_service")
    for name in node._parameter_overrides:
        if not node.has_parameter(name) and not name.startswith(own):
            known = sorted(name for name in node._parameters if not name.startswith(own))
            raise ParameterError(f"{name}: unknown; allowed: {', '.join(known)}")

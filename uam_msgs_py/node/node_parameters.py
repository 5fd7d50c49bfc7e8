"""ROS parameters of a node from a ParameterSet: declared, checked as a whole, replaced at once.

A change is checked on a copy of the whole set. A valid set takes effect between two control ticks.
An invalid one is refused with the reason; the old values stay in effect.
"""

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterValue,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from uam_control.settings.parameter_set import (
    Choice,
    ParameterError,
    ParameterSet,
    Spec,
    Switch,
    Text,
)
from uam_control.settings.texts import unknown, visible
from uam_msgs_py.node.namespace import shared_section

S = TypeVar("S", bound=ParameterSet)
SECRET = "set"  # shown in place of a secret


def descriptor(spec: Spec, read_only: bool, axes: Sequence[str] = ()) -> ParameterDescriptor:
    """Return the texts of `ros2 param describe`: meaning, unit, range, and the order of a vector.

    axes: names of the entries of a per-axis vector. Typing is dynamic, so that a user may write `5`
    for a float; the set checks the types.
    """
    text = ParameterDescriptor(
        description=spec.description,
        dynamic_typing=True,
        read_only=read_only or getattr(spec, "fixed", False),
    )
    if isinstance(spec, Choice):
        text.additional_constraints = "one of: " + ", ".join(spec.choices)
    elif isinstance(spec, Switch):
        text.additional_constraints = "true or false"
    elif isinstance(spec, Text):
        text.additional_constraints = spec.allowed
    elif spec.whole:
        text.additional_constraints = spec.allowed
        text.integer_range = [IntegerRange(from_value=spec.low, to_value=spec.high, step=1)]
    else:
        text.description = f"{spec.description} [{spec.unit}]"
        each = "" if spec.length is None else "each "
        order = f"; {', '.join(axes)}" if spec.length == 0 and axes else ""
        text.additional_constraints = f"{each}{spec.allowed}{order}"
        if spec.length is None:
            # float(): the C structure of an int would hold 5e-324
            low, high = float(spec.low), float(spec.high)
            text.floating_point_range = [
                FloatingPointRange(from_value=low, to_value=high, step=0.0)
            ]
    return text


class NodeParameters(Generic[S]):
    """The parameter set of one node, equal to its ROS parameters.

    `current`: the set in effect. `apply` is called with each accepted new set by the thread that
    spins the node, hence between two ticks.
    """

    def __init__(
        self,
        node: Node,
        kind: type[S],
        axes: Sequence[str] = (),
        defaults: dict[str, Any] | None = None,
        derived: dict[str, Any] | None = None,
        apply: Callable[[S], None] | None = None,
        read_only: bool = False,
    ):
        """Declare all parameters of `kind`.

        axes: names of the entries of a per-axis vector. defaults: values of the default profile for
        parameters that the parameter file omits; not used if that file is complete. derived: values
        from the vehicle's description, of lower priority than both. read_only: no changes after the
        start. Raises ParameterError for invalid values.
        """
        self._axes = len(axes)
        self.apply = apply
        own = {name: value for name, value in given(node).items() if name in kind.specs()}
        follows = {k: v for k, v in (derived or {}).items() if k in kind.specs()}
        base = {} if own and complete(kind, follows | own) else dict(defaults or {})
        self.current = kind.from_mapping(follows | base | own, self._axes)
        for name, spec in kind.specs().items():
            value = getattr(self.current, name)
            if getattr(spec, "secret", False) and value:
                value = SECRET
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
            return SetParametersResult(successful=False, reason=visible(error))
        return SetParametersResult(successful=True)

    def _swap(self, changes: list[Parameter]) -> None:
        new = self._candidate(changes)
        if new == self.current:
            return
        self.current = new
        if self.apply is not None:
            self.apply(new)


def declared_text(node: Node, name: str, default: str, spec: Text) -> str:
    """Declare a read-only text parameter and return its value.

    For texts that a node needs outside a ParameterSet. Raises ParameterError if the value is no
    text, for example a key that YAML reads as a number.
    """
    value = given(node).get(name, default)
    if not isinstance(value, str):
        raise ParameterError(f"{name}: {value!r} is no text; allowed: {spec.allowed}")
    node.declare_parameter(name, value, descriptor(spec, read_only=True), ignore_override=True)
    return value


def given(node: Node) -> dict[str, Any]:
    """Return the values of the parameter file and the command line, by name."""
    return {name: value.value for name, value in node._parameter_overrides.items()}


def plain(message: ParameterValue) -> Any:
    """Return the value of a parameter message as in YAML: arrays as lists."""
    value = parameter_value_to_python(message)
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def complete(kind: type[ParameterSet], given: dict[str, Any]) -> bool:
    """Return whether `given` has a value for every parameter without a default."""
    empty = [name for name in kind.specs() if getattr(kind, name, ()) == ()]
    return bool(given) and all(name in given for name in empty)


def refuse_unknown(node: Node, shown: str = "") -> None:
    """Raise ParameterError for a name in the parameter file that the node has not declared.

    A name in the section `/**` may be that of another node. shown: name of the node in the text,
    where the process has several.
    """
    prefix = f"{shown}: " if shown else ""
    own = ("use_sim_time", "qos_overrides.", "start_type_description_service")
    for name in given(node):
        if node.has_parameter(name) or name.startswith(own):
            continue
        if name not in shared_section():  # it reads the files: only for a name in question
            declared = node.get_parameters_by_prefix("")
            known = sorted(name for name in declared if not name.startswith(own))
            raise ParameterError(f"{prefix}{name}: {unknown(name, known)}")

"""Counts, texts and optional lists of a parameter set, and their ROS descriptors."""

import math
import re
from array import array
from dataclasses import dataclass

import numpy as np
import pytest

from uam_control.laws.modular import ModularLaw
from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    by_name,
    integer,
    number,
    text,
    vector,
)


@dataclass(frozen=True)
class Counted(ParameterSet):
    """A count, a text, a list that may be empty, and a number whose range is written by ints."""

    port: int = integer(14540, "a port", 1, 65535)
    file: str = text("", "a file", "a name; empty: none")
    start: tuple = vector((), "angles", "rad", -1.0, 1.0, optional=True)
    share: float = number(1, "a share", "1", 0, 1)


def test_a_count_stays_an_integer():
    made = Counted.from_mapping({"port": 65535}, axes=2)
    assert made.port == 65535 and isinstance(made.port, int)


@pytest.mark.parametrize(
    "values, reason",
    [
        ({"port": 0}, "port: 0 is outside 1 to 65535"),
        ({"port": 65536}, "port: 65536 is outside 1 to 65535"),
        ({"port": 14540.0}, "port: 14540.0 is no integer; allowed: 1 to 65535"),
        ({"port": True}, "port: True is no integer"),
        ({"port": math.nan}, "port: nan is no integer"),
        ({"port": "1"}, "port: '1' is no integer"),
        ({"file": 3}, "file: 3 is no text; allowed: a name; empty: none"),
        ({"start": [0.1]}, "start: a list of 2 numbers expected"),
        ({"start": [0.1, 2.0]}, "is outside -1 to 1 rad"),
        ({"start": array("d", [0.1])}, "start: a list of 2 numbers expected, got [0.1]; each"),
        ({"start": array("d", [0.1, 2.0])}, "start: [0.1, 2.0] is outside"),
        ({"start": np.array([True, False])}, "start: [True, False] is not numeric"),
    ],
)
def test_counts_texts_and_optional_lists_are_refused_with_the_reason(values, reason):
    with pytest.raises(ParameterError, match=re.escape(reason)):
        Counted.from_mapping(values, axes=2)


def test_an_optional_list_may_be_empty():
    assert Counted.from_mapping({"start": []}, axes=2).start == ()
    assert Counted.from_mapping({"start": [0.1, 0.2]}, axes=2).start == (0.1, 0.2)


def test_ranges_arrive_in_ros_as_they_are_written():
    """Serialized, as `ros2 param describe` gets them; an int in a float field became 5e-324."""
    pytest.importorskip("rclpy")
    from rcl_interfaces.msg import ParameterDescriptor
    from rclpy.serialization import deserialize_message, serialize_message

    from uam_msgs_py.node.node_parameters import descriptor

    specs = Counted.specs()
    sent = {
        name: deserialize_message(
            serialize_message(descriptor(spec, read_only=True)), ParameterDescriptor
        )
        for name, spec in specs.items()
    }
    (whole,) = sent["port"].integer_range
    assert (whole.from_value, whole.to_value, whole.step) == (1, 65535, 1)
    (share,) = sent["share"].floating_point_range
    assert (share.from_value, share.to_value) == (0.0, 1.0)
    assert not sent["file"].integer_range and not sent["file"].floating_point_range
    assert sent["file"].additional_constraints == "a name; empty: none"
    assert all(about.read_only for about in sent.values())


def test_a_name_of_two_laws_is_refused():
    class Copied(ModularLaw):
        """A law that was copied, and not named."""

    assert by_name("law", [ModularLaw]) == {"modular": ModularLaw}
    with pytest.raises(ParameterError, match="'modular' is the name of .*ModularLaw and"):
        by_name("law", [ModularLaw, Copied])

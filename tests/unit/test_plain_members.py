"""An enumeration with plain members is what it was, and its members are found without a call."""

import copy
from enum import Enum

from uam_control.settings.plain_members import plain_members
from uam_control.supervision import Event, Guide, OperatorCommand, State


@plain_members
class Colour(Enum):
    RED = "red"
    BLUE = "blue"
    AZURE = "blue"  # an alias


def test_members_are_attributes_of_the_class_itself():
    for kind in (Colour, State, Event, Guide, OperatorCommand):
        for name, member in kind.__members__.items():
            assert vars(kind)[name] is member is getattr(kind, name) is kind[name]


def test_the_enumeration_is_what_it_was():
    assert list(Colour) == [Colour.RED, Colour.BLUE] and Colour("red") is Colour.RED
    assert Colour.AZURE is Colour.BLUE and Colour.RED.name == "RED" and Colour.RED.value == "red"
    assert copy.deepcopy(State.FLYING) is State.FLYING

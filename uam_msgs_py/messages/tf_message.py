"""Poses of frames ↔ serialized tf2_msgs/msg/TFMessage, also without the package tf2_msgs.

RViz and Foxglove require /tf. Its type is part of ROS's apt packages, but not of the wheels on
PyPI. TFMessage is a sequence of TransformStamped. Its C type support is assembled from
common_interfaces: the type support of MarkerArray (also a sequence of messages) with another name
and another element type. Messages of this type can only be sent and received serialized; this
stack uses no other form, and the middleware sees no difference.

The C structures are those of ROS 2 Jazzy, whose binary interface is frozen.
"""

import ctypes
import struct
from collections.abc import Sequence
from ctypes import POINTER, c_char_p, c_size_t, c_uint8, c_uint64, c_void_p
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import TransformStamped
from visualization_msgs.msg import MarkerArray

from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import (
    ENCAPSULATION,
    BadMessage,
    Cursor,
    is_little_endian,
    stamp_of,
)

PACKAGE, NAME, FIELD = "tf2_msgs", "TFMessage", "transforms"
ELEMENT = "geometry_msgs/msg/TransformStamped"
DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
# sha256 of the type's description; publishers and subscribers compare it
HASH = bytes.fromhex("e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087")
FASTRTPS, INTROSPECTION = b"rosidl_typesupport_fastrtps_c", b"rosidl_typesupport_introspection_c"
NESTED_SEQUENCE = 145  # type_description_interfaces/msg/FieldType: unbounded sequence of messages
LITTLE_ENDIAN = b"\0\1\0\0"  # the encapsulation of plain CDR
NUMBERS = 7  # translation x y z, rotation x y z w


def structure(**fields: type) -> type[ctypes.Structure]:
    """Return the class of a C structure with these fields, in order."""
    return type("_Structure", (ctypes.Structure,), {"_fields_": list(fields.items())})


# Fields that are only copied have one name together.
_Hash = structure(version=c_uint8, value=c_uint8 * 32)
_String = structure(data=c_char_p, size=c_size_t, capacity=c_size_t)
_Sequence = structure(data=c_void_p, size=c_size_t, capacity=c_size_t)
_FieldType = structure(type_id=c_uint8, capacities=c_uint64 * 2, nested_type_name=_String)
_Field = structure(name=_String, type=_FieldType, default_value=_String)
_IndividualDescription = structure(type_name=_String, fields=_Sequence)
_Description = structure(own=_IndividualDescription, referenced=_Sequence)
# message_type_support_callbacks_t of rosidl_typesupport_fastrtps
_Callbacks = structure(namespace=c_char_p, name=c_char_p, functions=c_void_p * 5)
# MessageMember and MessageMembers of rosidl_typesupport_introspection_c
_Member = structure(name=c_char_p, type=c_uint64 * 2, members=c_void_p, rest=c_uint64 * 10)
_Members = structure(
    namespace=c_char_p,
    name=c_char_p,
    sizes=c_uint64 * 3,
    members=POINTER(_Member),
    functions=c_void_p * 2,
)


class _Support(ctypes.Structure):
    """rosidl_message_type_support_t."""


_FIND = ctypes.CFUNCTYPE(c_void_p, POINTER(_Support), c_char_p)
_GET = ctypes.CFUNCTYPE(c_void_p, POINTER(_Support))
_Support._fields_ = [
    *(("identifier", c_char_p), ("data", c_void_p), ("find", _FIND)),
    *(("hash", _GET), ("description", _GET), ("sources", _GET)),
]


def _string(text: str) -> ctypes.Structure:
    data = text.encode()
    return _String(data, len(data), len(data) + 1)


def _sequence(array: ctypes.Array) -> ctypes.Structure:
    return _Sequence(ctypes.addressof(array), len(array), len(array))


def _copy(kind: type[ctypes.Structure], address: int) -> ctypes.Structure:
    """Return a copy of the C structure at `address`."""
    return kind.from_buffer_copy(ctypes.string_at(address, ctypes.sizeof(kind)))


_capsule_name = ctypes.pythonapi.PyCapsule_GetName
_capsule_name.restype, _capsule_name.argtypes = c_char_p, [ctypes.py_object]
_capsule_pointer = ctypes.pythonapi.PyCapsule_GetPointer
_capsule_pointer.restype, _capsule_pointer.argtypes = c_void_p, [ctypes.py_object, c_char_p]
_capsule = ctypes.pythonapi.PyCapsule_New
_capsule.restype, _capsule.argtypes = ctypes.py_object, [c_void_p, c_char_p, c_void_p]


def _capsule_of(message_type: type):
    """Return the type support capsule of a generated message class."""
    if type(message_type)._TYPE_SUPPORT is None:
        type(message_type).__import_type_support__()
    return type(message_type)._TYPE_SUPPORT


def _support_of(message_type: type) -> _Support:
    capsule = _capsule_of(message_type)
    return _Support.from_address(_capsule_pointer(capsule, _capsule_name(capsule)))


def _found(support: _Support, identifier: bytes) -> _Support:
    """Return the type support for `identifier`; raises ImportError if there is none."""
    address = support.find(ctypes.byref(support), identifier)
    if not address:
        raise ImportError(f"no {identifier.decode()} to make {PACKAGE} from")
    return _Support.from_address(address)


class _Assembled:
    """The type support of TFMessage. Keep the object until the process ends."""

    def __init__(self):
        array, element = _support_of(MarkerArray), _support_of(TransformStamped)
        self._describe(_Description.from_address(element.description(ctypes.byref(element))))
        self._hash = _Hash(1, (c_uint8 * 32)(*HASH))
        self._sources = _Sequence()
        held = map(ctypes.addressof, (self._hash, self._description, self._sources))
        self._getters = [_GET(lambda _, at=at: at) for at in held]
        self._callbacks = _copy(_Callbacks, _found(array, FASTRTPS).data)
        self._callbacks.namespace, self._callbacks.name = b"tf2_msgs::msg", NAME.encode()

        self._members = _copy(_Members, _found(array, INTROSPECTION).data)
        self._member = _copy(_Member, ctypes.addressof(self._members.members[0]))
        self._member.name = FIELD.encode()
        self._member.members = ctypes.addressof(_found(element, INTROSPECTION))
        self._members.namespace, self._members.name = b"tf2_msgs__msg", NAME.encode()
        self._members.members = ctypes.pointer(self._member)

        self._find = _FIND(self._support)
        self._supports = {
            identifier: _Support(identifier, ctypes.addressof(data), self._find, *self._getters)
            for identifier, data in ((FASTRTPS, self._callbacks), (INTROSPECTION, self._members))
        }
        self._handle = _Support(b"rosidl_typesupport_c", None, self._find, *self._getters)
        self._capsule_name = _capsule_name(_capsule_of(TransformStamped))
        self.capsule = _capsule(ctypes.addressof(self._handle), self._capsule_name, None)

    def _describe(self, element: _Description) -> None:
        """Build the type description that a node's service get_type_description returns."""
        known = (_IndividualDescription * element.referenced.size).from_address(
            element.referenced.data
        )
        parts = sorted([*known, element.own], key=lambda part: part.type_name.data)
        self._referenced = (_IndividualDescription * len(parts))(*parts)
        kind = _FieldType(NESTED_SEQUENCE, (0, 0), _string(ELEMENT))
        self._fields = (_Field * 1)(_Field(_string(FIELD), kind, _string("")))
        own = _IndividualDescription(_string(f"{PACKAGE}/msg/{NAME}"), _sequence(self._fields))
        self._description = _Description(own, _sequence(self._referenced))

    def _support(self, _: ctypes._Pointer, identifier: bytes) -> int | None:
        support = self._supports.get(identifier)
        return None if support is None else ctypes.addressof(support)


class _Metaclass(type):
    """The attributes that rclpy requires of a message class."""

    # rclpy requires these but calls them only for deserialized messages, and would then raise
    _CREATE_ROS_MESSAGE = _CONVERT_FROM_PY = _CONVERT_TO_PY = _DESTROY_ROS_MESSAGE = "none"
    _TYPE_SUPPORT = None
    _assembled: _Assembled | None = None

    @classmethod
    def __import_type_support__(cls) -> None:
        cls._assembled = _Assembled()
        cls._TYPE_SUPPORT = cls._assembled.capsule


class TFMessage(metaclass=_Metaclass):
    """The type for rclpy's publishers and subscriptions; it has no instances."""

    _fields_and_field_types = {FIELD: "sequence<geometry_msgs/TransformStamped>"}

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Return the fields, as a generated class does."""
        return dict(cls._fields_and_field_types)


TFMessage.__module__ = f"{PACKAGE}.msg"


@dataclass(frozen=True)
class Transform:
    """Pose of frame `child` in frame `parent`."""

    stamp: int  # [ns]
    parent: str
    child: str
    position: np.ndarray  # (3,) [m]
    quaternion: np.ndarray  # (4,) [w x y z] child → parent


def transforms_message(transforms: Sequence[Transform]) -> bytes:
    """Return the serialized TFMessage of `transforms`."""
    data = bytearray(LITTLE_ENDIAN + struct.pack("<I", len(transforms)))
    for transform in transforms:
        _align(data, 4)
        data += struct.pack("<iI", *divmod(transform.stamp, SECOND))
        for name in (transform.parent, transform.child):
            _align(data, 4)
            text = name.encode() + b"\0"
            data += struct.pack("<I", len(text)) + text
        _align(data, 8)
        w, x, y, z = transform.quaternion
        data += struct.pack(f"<{NUMBERS}d", *transform.position, x, y, z, w)
    return bytes(data)


def read_transforms(data: bytes) -> list[Transform]:
    """Return the transforms of a serialized TFMessage; raises BadMessage for other data."""
    if not is_little_endian(data):
        raise BadMessage("transforms in the byte order of another machine")
    cursor = Cursor(data)
    return [_transform(cursor) for _ in range(cursor.count())]


def _transform(cursor: Cursor) -> Transform:
    stamp = stamp_of(cursor.data, cursor.stamp())
    parent, child = cursor.string(), cursor.string()
    numbers = np.frombuffer(cursor.data[cursor.forward(8 * NUMBERS, align=8)], "<f8")
    return Transform(stamp, parent, child, numbers[:3], np.roll(numbers[3:], 1))


def _align(data: bytearray, size: int) -> None:
    """Pad to a multiple of `size`, counted from the end of the encapsulation."""
    data += bytes(-(len(data) - ENCAPSULATION) % size)

"""tf2_msgs/msg/TFMessage, for installations without the package tf2_msgs.

RViz and Foxglove require /tf. Its type is part of ROS's apt packages, but not of the wheels on
PyPI. TFMessage is a sequence of TransformStamped. Its C type support is assembled from
common_interfaces: the type support of MarkerArray (also a sequence of messages) with another name
and another element type. Messages of this type can only be sent and received serialized; this
stack uses no other form, and the middleware sees no difference.

The C structures are those of ROS 2 Jazzy, whose binary interface is frozen.
"""

import ctypes
from ctypes import POINTER, c_char_p, c_size_t, c_uint8, c_uint64, c_void_p

from geometry_msgs.msg import TransformStamped
from visualization_msgs.msg import MarkerArray

PACKAGE, NAME, FIELD = "tf2_msgs", "TFMessage", "transforms"
DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
# sha256 of the type's description; publishers and subscribers compare it
HASH = bytes.fromhex("e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087")
FASTRTPS = b"rosidl_typesupport_fastrtps_c"  # of the only middleware among the wheels
NESTED_SEQUENCE = 145  # type_description_interfaces/msg/FieldType: unbounded sequence of messages


class _Hash(ctypes.Structure):
    _fields_ = [("version", c_uint8), ("value", c_uint8 * 32)]


class _String(ctypes.Structure):
    _fields_ = [("data", c_char_p), ("size", c_size_t), ("capacity", c_size_t)]

    @classmethod
    def of(cls, text: str) -> "_String":
        data = text.encode()
        return cls(data, len(data), len(data) + 1)


class _Sequence(ctypes.Structure):
    _fields_ = [("data", c_void_p), ("size", c_size_t), ("capacity", c_size_t)]

    @classmethod
    def of(cls, array: ctypes.Array) -> "_Sequence":
        return cls(ctypes.addressof(array), len(array), len(array))


class _FieldType(ctypes.Structure):
    _fields_ = [
        ("type_id", c_uint8),
        ("capacity", c_uint64),
        ("string_capacity", c_uint64),
        ("nested_type_name", _String),
    ]


class _Field(ctypes.Structure):
    _fields_ = [("name", _String), ("type", _FieldType), ("default_value", _String)]


class _IndividualDescription(ctypes.Structure):
    _fields_ = [("type_name", _String), ("fields", _Sequence)]


class _Description(ctypes.Structure):
    _fields_ = [("own", _IndividualDescription), ("referenced", _Sequence)]


class _Support(ctypes.Structure):
    """rosidl_message_type_support_t."""


_FIND = ctypes.CFUNCTYPE(c_void_p, POINTER(_Support), c_char_p)
_GET = ctypes.CFUNCTYPE(c_void_p, POINTER(_Support))
_Support._fields_ = [
    ("identifier", c_char_p),
    ("data", c_void_p),
    ("find", _FIND),
    ("hash", _GET),
    ("description", _GET),
    ("sources", _GET),
]


class _Callbacks(ctypes.Structure):
    """message_type_support_callbacks_t of rosidl_typesupport_fastrtps."""

    _fields_ = [
        ("namespace", c_char_p),
        ("name", c_char_p),
        ("serialize", c_void_p),
        ("deserialize", c_void_p),
        ("serialized_size", c_void_p),
        ("max_serialized_size", c_void_p),
        ("key_callbacks", c_void_p),
    ]


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


def _getter(held: ctypes.Structure):
    """Return a C function that returns the address of `held`."""
    address = ctypes.addressof(held)
    return _GET(lambda _: address)


class _Assembled:
    """The type support of TFMessage. Keep the object until the process ends."""

    def __init__(self):
        array, element = _support_of(MarkerArray), _support_of(TransformStamped)
        self._describe(_Description.from_address(element.description(ctypes.byref(element))))
        self._hash = _Hash(1, (c_uint8 * 32)(*HASH))
        self._sources = _Sequence()
        self._getters = [_getter(held) for held in (self._hash, self._description, self._sources)]
        address = array.find(ctypes.byref(array), FASTRTPS)
        if not address:
            raise ImportError(f"no {FASTRTPS.decode()} to make {PACKAGE} from")
        self._callbacks = _Callbacks()
        fast = _Callbacks.from_address(_Support.from_address(address).data)
        ctypes.pointer(self._callbacks)[0] = fast
        self._callbacks.namespace, self._callbacks.name = b"tf2_msgs::msg", NAME.encode()
        self._find = _FIND(self._support)
        callbacks = ctypes.addressof(self._callbacks)
        self._fast = _Support(FASTRTPS, callbacks, self._find, *self._getters)
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
        kind = _FieldType(NESTED_SEQUENCE, 0, 0, _String.of("geometry_msgs/msg/TransformStamped"))
        self._fields = (_Field * 1)(_Field(_String.of(FIELD), kind, _String.of("")))
        own = _IndividualDescription(
            _String.of(f"{PACKAGE}/msg/{NAME}"), _Sequence.of(self._fields)
        )
        self._description = _Description(own, _Sequence.of(self._referenced))

    def _support(self, _: ctypes._Pointer, identifier: bytes) -> int | None:
        return ctypes.addressof(self._fast) if identifier == FASTRTPS else None


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

"""Parameters of the autopilot: decoded by type, compared, adopted, missing."""

import math
import struct

import pytest

from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2
from uam_sim_bridge.mavlink.telemetry.parameter_check import (
    adopted,
    differences,
    expected,
    stream_loss,
    unanswered,
    value_of,
)


def decoded(value, kind, layout=None):
    """Return `value` after packing and decoding of a PARAM_VALUE."""
    if layout:
        value = struct.unpack("<f", struct.pack(layout, value).ljust(4, b"\0"))[0]
    message = mavlink2.MAVLink_param_value_message(b"NAME", value, kind, 1, 0)
    (arrived,) = Framer(Codec(1, 191)).datagram(Codec(1, 1).encode(message))
    return value_of(arrived)


def test_values_by_type():
    assert decoded(0.15, mavlink2.MAV_PARAM_TYPE_REAL32) == pytest.approx(0.15)
    for value in (0, 1, 7, 21196, -3, 2**31 - 1):
        assert decoded(value, mavlink2.MAV_PARAM_TYPE_INT32, "<i") == value
    assert decoded(200, mavlink2.MAV_PARAM_TYPE_UINT8, "<B") == 200
    assert decoded(-2, mavlink2.MAV_PARAM_TYPE_INT16, "<h") == -2


def test_the_same_values_change_nothing():
    mapping = RateThrustParameters.of(load_description())
    values = {
        name: struct.unpack("<f", struct.pack("<f", value))[0]
        for name, value in expected(mapping).items()
    }
    assert adopted(mapping, values) is mapping
    assert adopted(mapping, {}) is mapping


def test_adopted():
    values = {
        "MC_ROLLRATE_P": 0.3,
        "MC_YAWRATE_K": 2.0,
        "THR_MDL_FAC": struct.unpack("<f", struct.pack("<f", 0.1))[0],
    }
    new = adopted(RateThrustParameters.of(load_description()), values)
    assert new.rate_p == (0.3, 0.15, 0.2) and new.rate_k == (1.0, 1.0, 2.0)
    assert new.thr_mdl_fac == 0.1
    assert list(differences(new, values)) == []


def test_values_outside_the_range_of_the_mapping_are_refused():
    with pytest.raises(ParameterError, match="rate_p"):
        adopted(RateThrustParameters.of(load_description()), {"MC_ROLLRATE_P": 0.0})
    with pytest.raises(ParameterError, match="thr_mdl_fac"):
        adopted(RateThrustParameters.of(load_description()), {"THR_MDL_FAC": math.nan})


def test_loss_of_the_stream():
    assert list(stream_loss({})) == []
    assert list(stream_loss({"COM_OF_LOSS_T": 0.5})) == []
    assert list(stream_loss({"COM_OF_LOSS_T": 0.3})) == [
        "COM_OF_LOSS_T is 0.3 s on the autopilot: a gap of 0.5 s between setpoints starts its "
        "failsafe; set a longer time"
    ]
    assert "COM_OF_LOSS_T is 0 on the autopilot" in next(stream_loss({"COM_OF_LOSS_T": 0.0}))


def test_unanswered():
    assert list(unanswered(["THR_MDL_FAC"], 10)) == [
        "THR_MDL_FAC: no answer from the autopilot to 10 requests"
    ]

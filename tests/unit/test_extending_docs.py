"""The code of docs/extending.md runs."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from uam_control.setpoints.targets import Desired, level
from uam_control.stages.step import Stage
from uam_sim_bridge.faults import imu_faults
from uam_sim_bridge.faults.fault import Occurrence
from uam_sim_bridge.plant import Samples

TEXT = (Path(__file__).resolve().parents[2] / "docs/extending.md").read_text()
PARTS = TEXT.partition("## Parts of your own")[2]
STAGE, FAULT, SETPOINT = re.findall(r"^```python\n(.*?)^```$", PARTS, re.M | re.S)


def test_the_stage_limits_the_torque():
    names = {"np": np, "ControlTick": object, "Stage": Stage}
    exec(STAGE, names)  # noqa: S102 (our own docs)
    tick = SimpleNamespace(signals=SimpleNamespace(tau_q=np.array([1.0, -2.0, 0.5])))
    assert names["entry"].run(tick)
    assert tick.signals.tau_q.tolist() == [0.8, -0.8, 0.5]


def test_the_fault_scales_the_gyroscope():
    names = dict(vars(imu_faults))
    exec(FAULT, names)  # noqa: S102 (our own docs)
    fault = names["ImuScale"].from_mapping({"factor": 1.5, "unit": "companion"})
    imu = (0.0, np.array([0.1, -0.2, 0.3]), np.array([0.0, 0.0, 9.81]))
    samples = Samples(imu, None, None, imu)
    fault.sense(samples, Occurrence(np.random.default_rng(1)))
    assert samples.imu[1] == pytest.approx([0.15, -0.3, 0.45])
    assert samples.hil is imu and samples.imu[2] is imu[2]


def test_the_setpoint_type_sends_the_yaw_rate_of_the_reference():
    names: dict[str, object] = {}
    exec(SETPOINT, names)  # noqa: S102 (our own docs)
    attitude = level(0.4)
    attitude[0, 0] = math.pi / 6.0  # rolled by 30 deg
    attitude[1] = [0.0, 0.5 * math.sin(math.pi / 6.0), 0.5 * math.cos(math.pi / 6.0)]
    target = names["attitude_yaw_rate_setpoint"](Desired(np.zeros(3), attitude, 0.5))
    assert target.type_mask == 3 and not target.refused()
    assert target.rates == pytest.approx([0.0, 0.0, -0.5])  # 0.5 rad/s upwards, in NED

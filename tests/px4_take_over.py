"""A take-over as PX4 and the stack recorded it: requests, release, steps, tilt.

In lockstep PX4's log and the flight's log have one clock: that of the plant.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from pyulog import ULog

from uam_control.coordinates import ATTITUDE
from uam_control.maths.rotations import matrix_from_euler
from uam_control.offboard.modes import MavCmd
from uam_lab.records.results import timeseries
from uam_msgs_py.messages.status import MissionStatus

OFFBOARD, ARMED = 14, 2  # nav_state and arming_state of PX4's vehicle_status
BRIDGE = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
WATCHED = 1.0  # [s] of the laws after the return of control


@dataclass
class TakeOver:
    """Times [s] of the plant's clock; inf: it did not happen.

    left, back: PX4 leaves OFFBOARD, and flies it again; released: by the mission; commanded: the
    mission accepts `resume`; requests: of the bridge for mode or arming, as PX4 received them since
    `left` and while armed. rate_step [rad/s], thrust_step: largest change of the setpoint from tick
    to tick after `back`, and from PX4's own last setpoint to the first. tilt [deg]: the largest
    since `left`, of the plant.
    """

    left: float = np.inf
    released: float = np.inf
    commanded: float = np.inf
    back: float = np.inf
    requests: list[float] = field(default_factory=list)
    rate_step: float = 0.0
    thrust_step: float = 0.0
    tilt: float = 0.0
    abort_reason: str | None = None


def read(out: Path) -> TakeOver:
    """Return the first take-over of a flight from its result folder."""
    found, series = TakeOver(), timeseries.read(out / "timeseries.parquet")
    metrics = json.loads((out / "metrics.json").read_text())
    found.abort_reason = metrics["abort_reason"]
    _read_mission(out / "log.mcap", found)
    log = ULog(
        str(out / "px4.ulg"), ["vehicle_command", "vehicle_status", "vehicle_rates_setpoint"]
    )
    _read_modes(log, found)
    begun = next(move["time_s"] for move in metrics["transitions"] if move["to"] == "released")
    time = series.time + found.released - begun  # of the plant
    flown = time >= found.left
    angles = series.block("truth.")[flown, ATTITUDE]
    upward = [matrix_from_euler(row)[2, 2] for row in angles]
    found.tilt = float(np.degrees(np.arccos(min(1.0, *upward))))
    if found.back < np.inf:
        after = (time >= found.back) & (time < found.back + WATCHED)
        _read_steps(log, series.block("setpoint.")[after], found)
    return found


def _read_mission(file: Path, found: TakeOver) -> None:
    """Read when the mission was released, and when it accepted the command."""
    with file.open("rb") as opened:
        reader = make_reader(opened, decoder_factories=[DecoderFactory()])
        topics = ["/uam/mission/status", "/rosout"]
        for _, channel, raw, message in reader.iter_decoded_messages(topics=topics):
            if channel.topic == "/rosout":
                if message.name == "mission" and message.msg.startswith("command resume: resume"):
                    found.commanded = min(found.commanded, raw.log_time * 1e-9)
                continue
            stamp, status = MissionStatus.from_message(message)
            if status.state == "released":
                found.released = min(found.released, stamp * 1e-9)


def _read_modes(log: ULog, found: TakeOver) -> None:
    """Read PX4's changes of mode and the bridge's requests."""
    status = log.get_dataset("vehicle_status").data
    rows = zip(status["timestamp"] * 1e-6, status["nav_state"], status["arming_state"], strict=True)
    flown, landed = False, np.inf
    for time, mode, arming in rows:
        flown |= mode == OFFBOARD and arming == ARMED
        if flown and arming != ARMED:
            landed = time
            break
        if flown and mode != OFFBOARD:
            found.left = min(found.left, time)
        if mode == OFFBOARD and found.left < np.inf:
            found.back = min(found.back, time)
    sent = log.get_dataset("vehicle_command").data
    chosen = np.isin(sent["command"], (MavCmd.DO_SET_MODE, MavCmd.ARM_DISARM))
    times = sent["timestamp"][chosen & (sent["source_component"] == BRIDGE)] * 1e-6
    found.requests = [float(time) for time in times if found.left <= time <= landed]


def _read_steps(log: ULog, setpoints: np.ndarray, found: TakeOver) -> None:
    """Read the steps of the setpoints (ticks, 4): rates FLU [rad/s], thrust 0..1."""
    own = log.get_dataset("vehicle_rates_setpoint").data
    last = np.flatnonzero(own["timestamp"] * 1e-6 < found.back)[-1]
    before = [own[name][last] for name in ("roll", "pitch", "yaw", "thrust_body[2]")]
    rows = np.vstack([np.array(before) * (1.0, -1.0, -1.0, -1.0), setpoints])  # FRD to FLU
    steps = np.diff(rows, axis=0)
    found.rate_step = float(np.abs(steps[:, :3]).max())
    found.thrust_step = float(np.abs(steps[:, 3]).max())

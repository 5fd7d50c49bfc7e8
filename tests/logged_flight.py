"""The log of a made-up flight on a vehicle or in a rehearsal."""

import numpy as np
from rclpy.serialization import serialize_message

from uam_control.coordinates import coordinates
from uam_control.stamps import SECOND
from uam_lab.records.recording.bag import schema
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import ReferenceWriter
from uam_msgs_py.messages.convert import (
    JointStateWriter,
    PoseWriter,
    SetpointWriter,
    TrajectoryWriter,
)
from uam_msgs_py.messages.status import MissionStatus

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def vehicles_log(tmp_path, truth=False, released=range(0)):
    """A log of 3 s: the vehicle stands, then hovers 1 cm above its reference.

    truth: with the true state and rotors, as a rehearsal. released: ticks in which a pilot flies.
    """
    names = list(coordinates(2))
    state, reference = TrajectoryWriter(names), ReferenceWriter(2)
    chi, desired = np.zeros((3, 8)), np.zeros((3, 8))
    chi[0, 2], desired[0, 2] = 1.01, 1.0
    setpoint = SetpointWriter("base_link")
    payload, rotors = PoseWriter(), JointStateWriter(["1", "2", "3", "4"])
    log = BoundedLog(tmp_path / "log.mcap", 0.0)
    kinds = {
        topics.STATE: "trajectory_msgs/msg/JointTrajectory",
        topics.REFERENCE: "trajectory_msgs/msg/JointTrajectory",
        topics.SETPOINT: "geometry_msgs/msg/TwistStamped",
        topics.PAYLOAD: "geometry_msgs/msg/PoseStamped",
        topics.MISSION_STATUS: "diagnostic_msgs/msg/DiagnosticArray",
        topics.TRUTH_STATE: "trajectory_msgs/msg/JointTrajectory",
        topics.TRUTH_ROTORS: "sensor_msgs/msg/JointState",
    }
    channels = {
        topic: log.add_channel(f"/{topic.name}", kind, schema(kind), {})
        for topic, kind in kinds.items()
    }
    begun = 1_700_000_000 * SECOND

    def write(topic, stamp, message, late=0):
        log.write(channels[topic], stamp, stamp + late, bytes(message), 0)

    for k in range(750):
        stamp = begun + k * 4_000_000
        since = max(0, k - 250) * 4_000_000
        write(
            topics.REFERENCE,
            stamp,
            bytes(reference.fill(stamp, desired, k >= 250 and k not in released, since)),
        )
        write(topics.STATE, stamp, bytes(state.fill(stamp, chi)))
        if truth:
            write(topics.TRUTH_STATE, stamp, bytes(state.fill(stamp, chi)))
            write(topics.TRUTH_ROTORS, stamp, bytes(rotors.stamped(stamp)))
        late = 20_000_000 if k % 100 == 0 else 3_000_000
        write(topics.SETPOINT, stamp, bytes(setpoint.fill(stamp, np.zeros(3), 0.5)), late)
        write(topics.PAYLOAD, stamp, bytes(payload.fill(stamp, np.array([1.0, 2.0, 0.1]), LEVEL)))
    statuses = {0: MissionStatus("hover"), 500: MissionStatus("hover", magnet=True)}
    if released:
        statuses[released.start] = MissionStatus("released", state="released")
        statuses[released.stop] = MissionStatus("hover")
    for k, status in sorted(statuses.items()):
        stamp = begun + k * 4_000_000
        write(topics.MISSION_STATUS, stamp, serialize_message(status.to_message(stamp)))
    log.close()
    return tmp_path / "log.mcap"

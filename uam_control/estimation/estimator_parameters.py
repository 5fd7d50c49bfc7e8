"""Parameters of the state estimator."""

from dataclasses import dataclass

from uam_control.estimation.base import BaseParameters
from uam_control.estimation.pose_filter import allowed_bandwidth
from uam_control.settings.parameter_set import ParameterSet, choice, number

REPORTED, OBSERVER = "reported", "observer"  # where the velocity of a joint comes from
MOCAP, ODOMETRY = "mocap", "odometry"  # where the poses come from


@dataclass(frozen=True)
class PoseSourceParameters(ParameterSet):
    """Source of the poses, of all nodes that read them; fixed once the node runs."""

    pose_source: str = choice(
        MOCAP,
        "poses of a motion capture, or of an odometry (odometry/in), whose jumps are taken out",
        (MOCAP, ODOMETRY),
    )


@dataclass(frozen=True)
class EstimatorParameters(BaseParameters):
    """Bandwidths and corner frequencies of the estimator's filters, and gravity."""

    estimator: str = choice(
        "complementary", "the estimator that flies, fixed", ("complementary",), fixed=True
    )
    position_bandwidth: float = number(
        12.0, "correction of position by motion capture", "rad/s", 0.5, 60.0
    )
    attitude_bandwidth: float = number(
        8.0, "correction of attitude by motion capture", "rad/s", 0.5, 60.0
    )
    pose_gate: float = number(
        0.15, "jump of the motion capture from which its poses are rejected", "m", 0.05, 1000.0
    )
    joint_bandwidth: float = number(
        60.0, "correction of joint state by the encoder angle", "rad/s", 1.0, 125.0
    )
    joint_velocity_weight: float = number(
        80.0, "correction of joint state by the encoder velocity", "1/s", 0.0, 200.0
    )
    joint_velocity: str = choice(
        REPORTED,
        "velocity of a joint: the servo's corrects it, or an observer of its angle makes it",
        (REPORTED, OBSERVER),
    )
    joint_observer_bandwidth: float = number(
        20.0, "of the observer; its velocity is 0.23 / bandwidth late", "Hz", 1.0, 60.0
    )
    acceleration_cutoff: float = number(
        5.0, "low-pass on the acceleration of the vehicle", "Hz", 0.1, 100.0
    )
    angular_acceleration_cutoff: float = number(
        10.0, "low-pass on the derivative of the body rates", "Hz", 0.1, 100.0
    )
    joint_acceleration_cutoff: float = number(
        5.0, "low-pass on the derivative of the joint velocities", "Hz", 0.1, 100.0
    )

    def capped(self, interval: float) -> list[str]:
        """Return a line per bandwidth that is too large for a pose every `interval` [s]."""
        allowed = allowed_bandwidth(interval)
        given = ("position_bandwidth", "attitude_bandwidth")
        why = f"{allowed:.3g}: a pose comes every {1e3 * interval:.3g} ms"
        return [
            f"{name} {value:g} rad/s acts as {why}"
            for name in given
            if (value := getattr(self, name)) > allowed
        ]

"""What an estimator is: its parameters, the samples that it takes, the state that it gives."""

from dataclasses import dataclass

import numpy as np

from uam_control.settings.parameter_set import ParameterSet, choice, number
from uam_control.vehicle import GRAVITY


@dataclass(frozen=True)
class BaseParameters(ParameterSet):
    """Parameters of every estimator."""

    estimator: str = choice("", "the estimator that flies", (), fixed=True)
    gravity: float = number(GRAVITY, "acceleration of gravity", "m/s^2", 0.0, 30.0)

    def capped(self, interval: float) -> list[str]:
        """Return a line per parameter that cannot act in full with a pose every `interval` [s]."""
        return []


class Estimator:
    """Takes samples in order of arrival, stamps in [s]; listed in `catalogue.ESTIMATORS`."""

    kind: type[BaseParameters]  # of its parameters; the default of their `estimator` is its name
    complete: bool  # whether every input has delivered a sample
    bias_known = False  # whether `imu_bias` may be judged
    refused_poses = 0  # number of poses that were not believed

    def __init__(self, parameters: BaseParameters, joints: int) -> None:
        """joints: how many the arm has."""
        raise NotImplementedError

    def set_parameters(self, parameters: BaseParameters) -> None:
        """Use `parameters` (validated) from the next sample on."""
        self.parameters = parameters

    def use_odometry(self) -> None:
        """The poses are those of an odometry: noisier than a motion capture's."""

    def forget(self) -> None:
        """Begin anew; parameters stay."""
        raise NotImplementedError

    def mocap(self, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Take a pose exposed at `stamp`: position (3,) [m, ENU], quaternion (4,) [w x y z]."""
        raise NotImplementedError

    def imu(self, stamp: float, gyro: np.ndarray, force: np.ndarray) -> None:
        """Take an IMU sample: gyro (3,) [rad/s], specific force (3,) [m/s^2], FLU."""
        raise NotImplementedError

    def joints(self, stamp: float, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
        """Take joint readings: alpha (n,) [rad], alpha_dot (n,) [rad/s]."""
        raise NotImplementedError

    def update(self) -> np.ndarray:
        """Return state (3, 6 + n) at the newest IMU stamp, see `coordinates`; overwritten later."""
        raise NotImplementedError

    @property
    def imu_bias(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the estimated biases (3,) of gyroscope [rad/s] and accelerometer [m/s^2], FLU."""
        return np.zeros(3), np.zeros(3)

"""One control tick of the plant: sensors out, motor commands and joint efforts in."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from uam_control.maths.compiled import jit
from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.plant.actuators import Rotors, Servos, rotor_step, servo_step
from uam_sim_bridge.plant.magnet import magnet_constants, pull_fraction
from uam_sim_bridge.plant.sensors import Delay, Encoders, Imu, Mocap, Noise, generators
from uam_sim_bridge.plant.vehicle import Vehicle


@dataclass
class Samples:
    """What arrives at one tick; each entry None or a tuple that begins with its stamp [s].

    imu: (stamp, gyro (3,) [rad/s], specific force (3,) [m/s^2]), FLU, as the companion computer
    gets it. joints: (stamp, alpha (n,), alpha_dot (n,), torque (n,)). mocap: (stamp, position (3,),
    quaternion [w x y z]). hil: as imu, undelayed, for the autopilot's own sensors.
    """

    imu: tuple | None
    joints: tuple | None
    mocap: tuple | None
    hil: tuple


@dataclass
class Truth:
    """What no controller sees. state (3, 8) as in uam_control.coordinates; the rest SI."""

    state: np.ndarray
    quaternion: np.ndarray
    payload_position: np.ndarray
    payload_quaternion: np.ndarray
    magnet_force: float
    magnet_swing: float
    rotor_speed: np.ndarray
    rotor_thrust: np.ndarray


class Plant:
    """S-500 with arm, magnet and payload; see config/vehicle/ for its numbers.

    At a tick: `sense()`, then `step(...)`, which advances one control period.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        payload_mass: float,
        seed: int,
        arm_start: tuple[float, float] = (0.0, np.pi / 2.0),
    ) -> None:
        """payload_mass [kg], 0 for none; arm_start: joint angles on the ground [rad]."""
        numbers = vehicle.numbers
        self.vehicle = vehicle
        self.period: float = numbers["control_period"]
        self.tick = 0
        self.model = model = self._compile(vehicle, payload_mass)
        self.data = data = mujoco.MjData(model)
        self._steps = round(self.period / model.opt.timestep)
        self._lay_out(payload_mass, arm_start)

        scale = numbers["sensors"]["noise_scale"]
        imu_noise, mocap_noise, gusts = generators(seed, 3)
        sensors = numbers["sensors"]
        self._imu = Imu(sensors["imu"], scale, imu_noise)
        self._mocap = Mocap(sensors["mocap"], scale, mocap_noise)
        self._encoders = Encoders(sensors["joints"])
        self._delays = {
            name: Delay(sensors[name]["latency_ticks"]) for name in ("imu", "mocap", "joints")
        }
        self._effort_delay = Delay(numbers["servos"]["command_latency_ticks"])
        self._effort = np.zeros(2)

        self.rotors = Rotors(numbers["rotors"], model.opt.timestep)
        self.servos = Servos(numbers["servos"], 2)
        air = numbers["air"]
        self._drag = np.array(air["drag"], dtype=float)
        self._wind_mean = np.array(air["wind"], dtype=float)
        self.wind = self._wind_mean.copy()
        self._gust_keep = np.exp(-self.period / air["gust_time"])
        spread = air["gust"] * np.sqrt(1.0 - self._gust_keep**2)
        self._gust = Noise(gusts, np.full(3, spread)) if air["gust"] else None

        mujoco.mj_forward(model, data)
        self._specific_force = self._sensed_force.copy()

    def _compile(self, vehicle: Vehicle, payload_mass: float) -> mujoco.MjModel:
        """The model; payload_mass [kg]."""
        return vehicle.compile(payload_mass)

    def _lay_out(self, payload_mass: float, arm_start: tuple[float, float]) -> None:
        """Keep views into MuJoCo's arrays and set the starting pose."""
        data, joint = self.data, self.model.joint
        base_q, base_v = joint("base").qposadr[0], joint("base").dofadr[0]
        self._position = data.qpos[base_q : base_q + 3]
        self._quaternion = data.qpos[base_q + 3 : base_q + 7]
        self._velocity = data.qvel[base_v : base_v + 3]
        self._rates = data.qvel[base_v + 3 : base_v + 6]
        arm_q, arm_v = joint("alpha_1").qposadr[0], joint("alpha_1").dofadr[0]
        self._alpha = data.qpos[arm_q : arm_q + 2]
        self._alpha_dot = data.qvel[arm_v : arm_v + 2]
        self._base_acceleration = data.qacc[base_v : base_v + 6]
        self._alpha_ddot = data.qacc[arm_v : arm_v + 2]
        self._swing = joint("magnet_swing").qposadr[0]
        payload_q = joint("payload").qposadr[0]
        self._payload_pose = data.qpos[payload_q : payload_q + 7]
        self._payload_position = self._payload_pose[0:3]
        self._sensed_force = data.sensordata[0:3]
        self._control = data.ctrl[0:6]
        self._force_on_base = data.xfrc_applied[self.model.body("base").id, 0:3]
        self._magnet_gain = self.model.actuator("magnet").gainprm[0]
        self._magnet_control = data.ctrl[6:7]
        self._face = data.site_xpos[self.model.site("magnet_face").id]
        self._payload_axes = data.xmat[self.model.body("payload").id]
        gap_scale = self.vehicle.numbers["magnet"]["gap_scale"]
        self._magnet_constants = magnet_constants(self.model, gap_scale)
        self._alpha[:] = arm_start
        data.qpos[self._swing] = -sum(arm_start)
        self._payload_position[0:2] += self.vehicle.numbers["variation"]["payload_offset"]
        if payload_mass <= 0.0:  # out of the way rather than another model
            self._payload_position[:] = (5.0, 5.0, 0.02)

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self.tick * self.period

    def sense(self) -> Samples:
        """Expose the sensors at this tick and return what arrives now (call once per tick)."""
        tick, time = self.tick, self.tick * self.period
        gyro, force = self._imu.sample(self._rates, self._specific_force)
        hil = (time, gyro, force)
        delays = self._delays
        delays["imu"].put(tick, hil)
        alpha, alpha_dot = self._encoders.sample(self._alpha, self._alpha_dot)
        delays["joints"].put(tick, (time, alpha, alpha_dot, self.servos.torque.copy()))
        if self._mocap.due(time):
            delays["mocap"].put(tick, (time, *self._mocap.sample(self._position, self._quaternion)))
        return Samples(
            delays["imu"].take(tick), delays["joints"].take(tick), delays["mocap"].take(tick), hil
        )

    def step(self, motor_commands: np.ndarray, arm_effort: np.ndarray, magnet: bool) -> None:
        """Advance one control period.

        motor_commands (4,) 0..1 in PX4 order, arm_effort (2,) [N m] as sent now (the bus delays
        it), magnet: current on.
        """
        self._effort_delay.put(self.tick, (float(arm_effort[0]), float(arm_effort[1])))
        due = self._effort_delay.take(self.tick)
        if due is not None:
            self._effort[:] = due
        if self._gust is not None:
            self.wind += (1.0 - self._gust_keep) * (self._wind_mean - self.wind) + self._gust()
        surroundings(
            self._drag,
            self._velocity,
            self.wind,
            self._force_on_base,
            magnet,
            self._face,
            self._payload_position,
            self._payload_axes,
            self._magnet_constants,
            self._magnet_control,
            self._specific_force,
        )
        rotors, servos = self.rotors, self.servos
        for _ in range(self._steps):
            actuate(
                motor_commands,
                rotors.constants,
                rotors.efficiency,
                rotors.speed,
                rotors.thrust,
                self._effort,
                self._alpha_dot,
                servos.constants,
                servos.torque,
                self._control,
            )
            mujoco.mj_step(self.model, self.data)
            average(self._sensed_force, 1.0 / self._steps, self._specific_force)
        self.tick += 1

    def write_truth_state(self, state: np.ndarray) -> None:
        """Write chi, chi_dot, chi_ddot into state (3, 8)."""
        write_state(
            self._position,
            self._quaternion,
            self._velocity,
            self._rates,
            self._alpha,
            self._alpha_dot,
            self._base_acceleration,
            self._alpha_ddot,
            state,
        )

    @property
    def payload_pose(self) -> np.ndarray:
        """Position [m] and quaternion [w x y z] (7,) of the payload: a view, to be copied."""
        return self._payload_pose

    @property
    def magnet_force(self) -> float:
        """Holding force of the magnet at the present air gap [N]."""
        return float(self._magnet_control[0] * self._magnet_gain)

    @property
    def magnet_swing(self) -> float:
        """Angle of the magnet's pivot [rad], relative to link 2."""
        return float(self.data.qpos[self._swing])

    def truth(self) -> Truth:
        """Return a copy of everything true at this tick."""
        state = np.empty((3, 8))
        self.write_truth_state(state)
        return Truth(
            state=state,
            quaternion=self._quaternion.copy(),
            payload_position=self._payload_position.copy(),
            payload_quaternion=self._payload_pose[3:7].copy(),
            magnet_force=self.magnet_force,
            magnet_swing=self.magnet_swing,
            rotor_speed=self.rotors.speed.copy(),
            rotor_thrust=self.rotors.thrust.copy(),
        )


@jit
def write_state(
    position: np.ndarray,
    quaternion: np.ndarray,
    velocity: np.ndarray,
    rates: np.ndarray,
    alpha: np.ndarray,
    alpha_dot: np.ndarray,
    base_acceleration: np.ndarray,
    alpha_ddot: np.ndarray,
    state: np.ndarray,
) -> None:
    """Gather chi, chi_dot, chi_ddot into state (3, 8)."""
    euler = euler_from_quaternion(quaternion)
    for i in range(3):
        state[0, i], state[0, 3 + i] = position[i], euler[i]
        state[1, i], state[1, 3 + i] = velocity[i], rates[i]
        state[2, i], state[2, 3 + i] = base_acceleration[i], base_acceleration[3 + i]
    for i in range(2):
        state[0, 6 + i], state[1, 6 + i], state[2, 6 + i] = alpha[i], alpha_dot[i], alpha_ddot[i]


@jit
def surroundings(
    drag: np.ndarray,
    velocity: np.ndarray,
    wind: np.ndarray,
    force: np.ndarray,
    magnet: bool,
    face: np.ndarray,
    payload: np.ndarray,
    payload_axes: np.ndarray,
    gap_constants: np.ndarray,
    magnet_control: np.ndarray,
    specific_force: np.ndarray,
) -> None:
    """Before a tick: drag -c (v - wind) [N, world] into force (3,), pull of the magnet at its gap.

    Also clears specific_force (3,) for the average over the physics steps of the tick.
    """
    for i in range(3):
        force[i] = drag[i] * (wind[i] - velocity[i])
        specific_force[i] = 0.0
    magnet_control[0] = pull_fraction(face, payload, payload_axes, gap_constants) if magnet else 0.0


@jit
def actuate(
    commands: np.ndarray,
    rotor_constants: np.ndarray,
    efficiency: np.ndarray,
    speed: np.ndarray,
    thrust: np.ndarray,
    effort: np.ndarray,
    joint_rates: np.ndarray,
    servo_constants: np.ndarray,
    torque: np.ndarray,
    control: np.ndarray,
) -> None:
    """Before a physics step: rotors into control[0:4] [N], servos into control[4:6] [N m]."""
    rotor_step(commands, rotor_constants, efficiency, speed, thrust, control[0:4])
    servo_step(effort, joint_rates, servo_constants, torque, control[4:6])


@jit
def average(sample: np.ndarray, weight: float, mean: np.ndarray) -> None:
    """Add weight * sample (3,) to mean (3,)."""
    for i in range(3):
        mean[i] += weight * sample[i]

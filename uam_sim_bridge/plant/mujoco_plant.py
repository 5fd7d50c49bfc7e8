"""The plant in MuJoCo: rigid bodies and contacts; rotors, servos, magnet, air and sensors."""

from collections.abc import Sequence

import mujoco
import numpy as np

from uam_control.maths.compiled import prepared
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Number, record
from uam_control.vehicle import VehicleError
from uam_sim_bridge.plant.actuators import Rotors, Servos
from uam_sim_bridge.plant.effects.acting_effects import ActingEffects
from uam_sim_bridge.plant.effects.effect import Bench
from uam_sim_bridge.plant.engine_step import failure
from uam_sim_bridge.plant.gripper import Fingers
from uam_sim_bridge.plant.magnet import NO_MAGNET, PayloadHinge, add_to, magnet_constants
from uam_sim_bridge.plant.observation import (
    REAL,
    WHOLE,
    Observed,
    PlantArrays,
    sense,
    step,
    write_truth,
)
from uam_sim_bridge.plant.physics import PhysicsArrays
from uam_sim_bridge.plant.plant import Disturbance, PhysicsError, Plant, Samples, Truth
from uam_sim_bridge.plant.sensors import (
    BLOCK,
    PAYLOAD_POSE,
    VEHICLE_POSE,
    Imu,
    Mocap,
    Noise,
    encoder_units,
    generators,
)
from uam_sim_bridge.plant.vehicle import BASE, FACE, MAGNET, PAYLOAD, SWING, Vehicle

STIFF = 0.9999  # constraint impedance for friction without creep, see MuJoCo's solimp


class MujocoPlant(Plant):
    """Vehicle with arm, magnet and payload in MuJoCo; the numbers are in config/vehicle/.

    `arrays`: all that compiled functions use, never replaced.
    """

    HAS_EFFECTS = True
    tick, magnet_gain, gusty, imu_late, joints_late = (Number() for _ in range(5))

    def __init__(
        self,
        vehicle: Vehicle,
        payload_mass: float,
        seed: int,
        arm_start: Sequence[float] = (),
        disturbed: bool = False,
    ) -> None:
        """payload_mass [kg], 0 for none; seed: of all noise; arm_start (n,) [rad]: joint angles on
        the ground, empty: stowed as described; disturbed: `disturb` will be called."""
        self.memory = record(WHOLE, REAL)
        super().__init__(vehicle)
        numbers, hinged = vehicle.numbers, disturbed and vehicle.description.has_magnet
        self.model = model = vehicle.compile(payload_mass, add_to if hinged else None)
        self.data = data = mujoco.MjData(model)
        self._steps = round(self.period / model.opt.timestep)
        self._lay_out(payload_mass, arm_start or vehicle.description.stowed)

        scale = numbers["sensors"]["noise_scale"]
        imu_noise, mocap_noise, gusts, payload_noise = generators(seed, 4)
        sensors = numbers["sensors"]
        self._imu = Imu(sensors["imu"], scale, imu_noise)
        noises = mocap_noise, payload_noise
        self._mocap = Mocap(sensors["mocap"], scale, noises, self._payload_top)
        self._encoder_units = encoder_units(sensors["joints"])

        self.rotors = Rotors(numbers["rotors"], model.opt.timestep)
        self.servos = Servos(numbers["servos"], self._alpha)
        air = numbers["air"]
        self._drag = np.array(air["drag"], dtype=float)
        self._wind_mean = np.array(air["wind"], dtype=float)
        self.wind = self._wind_mean.copy()
        keep = np.exp(-self.period / air["gust_time"])
        self._gust_keep = np.array([keep])
        spread = air["gust"] * np.sqrt(1.0 - keep**2)
        self._gust = Noise(gusts, np.full(3, spread))

        mujoco.mj_forward(model, data)
        self._specific_force = self._sensed_force.copy()
        self._drawn, self._observed = range(0), -1  # ticks that have noise, newest observed one
        self._added_wind = np.zeros(3)  # by disturbances
        self._swing_rate: float | None = None  # [rad/s] of a payload that hangs on the hinge
        self._hinge = PayloadHinge(model, data) if hinged else None
        self._arm_dofs = [model.joint(name).dofadr[0] for name in vehicle.description.joint_names]
        self.effects = ActingEffects(numbers["effects"], self._bench(), seed)
        self._unused_truth = np.empty(self.truth_row.width)
        self._prepare(air["gust"] > 0.0)
        self._undisturbed = (
            self.rotors.efficiency.copy(),
            model.dof_frictionloss[self._arm_dofs].copy(),
            model.dof_solimp[self._arm_dofs].copy(),
            self.magnet_gain,
        )

    def _lay_out(self, payload_mass: float, arm_start: Sequence[float]) -> None:
        """Store views into MuJoCo's arrays and set the initial pose."""
        data, joint, described = self.data, self.model.joint, self.vehicle.description
        base_q, base_v = joint(BASE).qposadr[0], joint(BASE).dofadr[0]
        self._position = data.qpos[base_q : base_q + 3]
        self._quaternion = data.qpos[base_q + 3 : base_q + 7]
        self._velocity = data.qvel[base_v : base_v + 3]
        self._rates = data.qvel[base_v + 3 : base_v + 6]
        first, names = described.joint_names[0], described.joint_names
        arm_q, arm_v = joint(first).qposadr[0], joint(first).dofadr[0]
        self._in_a_row("joint", [joint(name).dofadr[0] for name in names])
        self._alpha = data.qpos[arm_q : arm_q + self.joints]
        self._alpha_dot = data.qvel[arm_v : arm_v + self.joints]
        self._push = data.qfrc_applied[base_v : base_v + 6]
        payload_q = joint(PAYLOAD).qposadr[0]
        self._payload_pose = data.qpos[payload_q : payload_q + 7]
        self._payload_position = self._payload_pose[0:3]
        plate = self.model.geom("payload_plate")
        self._payload_top = float(plate.pos[2] + plate.size[2])
        sensed = self.model.sensor("specific_force").adr[0]
        self._sensed_force = data.sensordata[sensed : sensed + 3]
        self._thrust_control = self._controls(described.rotor_names)
        self._torque_control = self._controls(names)
        self._force_on_base = data.xfrc_applied[self.model.body(BASE).id, 0:3]
        # of the same instant as the face: qpos is a physics step later
        self._payload_centre = data.xpos[self.model.body(PAYLOAD).id]
        self._payload_axes = data.xmat[self.model.body(PAYLOAD).id]
        self._alpha[:] = arm_start
        self._lay_out_magnet(-sum(arm_start))
        self._fingers = Fingers(self.model, data, self.vehicle.numbers.get("gripper"))
        self._fingers.pace(self.period)
        self._payload_position[0:2] += self.vehicle.numbers["variation"]["payload_offset"]
        if payload_mass <= 0.0:  # moved far away: the model stays the same
            self._payload_position[:] = (5.0, 5.0, 0.02)

    def _lay_out_magnet(self, level: float) -> None:
        """Store views of the magnet, which hangs at an angle [rad]; zeros without a magnet."""
        self.magnet_gain, self._magnet_control = 0.0, np.zeros(1)
        self._face, self._magnet_constants = np.zeros(3), NO_MAGNET
        self._swing_angle = np.zeros(1)
        if not self.vehicle.description.has_magnet:
            return
        swing, magnet = self.model.joint(SWING).qposadr[0], self.vehicle.numbers["magnet"]
        self._swing_angle = self.data.qpos[swing : swing + 1]
        self._swing_angle[:] = level
        self._face = self.data.site_xpos[self.model.site(FACE).id]
        self.magnet_gain = float(self.model.actuator(MAGNET).gainprm[0])
        self._magnet_control = self._controls((MAGNET,))
        curve = magnet.get("curve", ())
        self._magnet_constants = magnet_constants(self.model, magnet["gap_scale"], curve)

    def _physics_arrays(self) -> PhysicsArrays:
        return PhysicsArrays(
            rotors=self.rotors.arrays,
            thrust_control=self._thrust_control,
            servos=self.servos.arrays,
            angles=self._alpha,
            joint_rates=self._alpha_dot,
            torque_control=self._torque_control,
            drag=self._drag,
            velocity=self._velocity,
            wind=self.wind,
            wind_mean=self._wind_mean,
            gust_keep=self._gust_keep,
            force=self._force_on_base,
            face=self._face,
            payload=self._payload_centre,
            payload_axes=self._payload_axes,
            gap_constants=self._magnet_constants,
            magnet_control=self._magnet_control,
            finger_ends=self._fingers.ends,
            finger_goal=self._fingers.goal,
            sensed_force=self._sensed_force,
            specific_force=self._specific_force,
        )

    def _observed_arrays(self) -> Observed:
        data, names = self.data, self.vehicle.description.joint_names
        base, arm = (self.model.joint(name).dofadr[0] for name in (BASE, names[0]))
        return Observed(
            position=self._position,
            quaternion=self._quaternion,
            velocity=self._velocity,
            rates=self._rates,
            alpha=self._alpha,
            alpha_dot=self._alpha_dot,
            base_acceleration=data.qacc[base : base + 6],
            alpha_ddot=data.qacc[arm : arm + self.joints],
            specific_force=self._specific_force,
            imu_bias=self._imu.bias,
            servo_torque=self.servos.torque,
            encoder_units=self._encoder_units,
            rotor_thrust=self.rotors.thrust,
            payload=self._payload_pose,
            magnet_control=self._magnet_control,
            swing=self._swing_angle,
            opening=self._fingers.opening,
            grip_force=self._fingers.force,
        )

    def _prepare(self, gusty: bool) -> None:
        """Collect the arrays; look up the machine code of what each tick calls."""
        sensors, motors = self.vehicle.numbers["sensors"], np.empty(self.rotors.speed.size)
        late = [sensors[name]["latency_ticks"] for name in ("imu", "joints")]
        addresses = self.model._address, self.data._address
        self.memory[0] = (
            *(self.tick, self._steps, *addresses, gusty, *late),
            *(self.period, self.magnet_gain),
        )
        self.arrays = a = PlantArrays(
            *(self._physics_arrays(), self._observed_arrays(), self.truth_row),
            *(self._imu.noise.arrays, self._gust.arrays, self._mocap.arrays, self.effects.arrays),
            np.zeros((max(late) + 1, 8 + 3 * self.joints)),
            np.full(max(late) + 1, np.iinfo(np.int64).min),
            self.memory,
        )
        truth = self._unused_truth
        self._sense = bound(sense, a, truth)
        self._step = bound(step, a, motors, np.empty(self.joints), True)
        self._write_truth = prepared(write_truth, a.observed, 1.0, a.truth, truth)

    def _bench(self) -> Bench:
        """Return the parts on which effects act."""
        first = self.vehicle.description.joint_names[0]
        return Bench(
            vehicle=self.vehicle,
            model=self.model,
            data=self.data,
            rotors=self.rotors,
            mocap=self._mocap,
            period=self.period,
            arm=(self.model.joint(first).dofadr[0], self.joints),
            torque_control=self._torque_control,
            encoder_units=self._encoder_units,
            sample=np.empty(8 + 3 * self.joints),
            pose=self._mocap.arrays.taken[VEHICLE_POSE],
        )

    def _controls(self, names: Sequence[str]) -> np.ndarray:
        """Return a view (len(names),) of the controls of these actuators."""
        found = [self.model.actuator(name).id for name in names]
        self._in_a_row("actuator", found)
        return self.data.ctrl[found[0] : found[-1] + 1]

    def _in_a_row(self, kind: str, numbers: Sequence[int]) -> None:
        """Raise VehicleError if the parts are not adjacent or not in the description's order."""
        if list(numbers) != list(range(numbers[0], numbers[0] + len(numbers))):
            described = self.vehicle.description
            raise VehicleError(
                f"{described.model}: each {kind} must follow the one before it in "
                f"{described.file.name}"
            )

    def sense(self) -> Samples:
        return self.observe(self._unused_truth)

    def observe(self, row: np.ndarray) -> Samples:
        if self.tick == self._observed or self.tick not in self._drawn:
            self.draw_noise()
        self._observed = self.tick
        self._sense(row)
        self.effects.check()
        return self.arrived()

    @property
    def compiled(self) -> bool:
        """Whether `sense` and `step` of `observation` are all that a tick does."""
        hinge = self._hinge
        free = hinge is None or (self._swing_rate is None and not hinge.closed)
        return self.effects.compiled and free

    def draw_noise(self) -> int:
        """Draw the noise that is due; return for how many ticks it lasts at least."""
        gusts = self._gust.draw() if self.gusty else BLOCK
        poses = self._mocap.draw(self.period)
        lasts = min(self._imu.noise.draw(), poses, gusts, self.effects.draw())
        self._drawn = range(self.tick, self.tick + lasts)
        return lasts

    def arrived(self) -> Samples:
        """Return the samples that have arrived at this tick, as copies."""
        tick, n, taken = self.tick, self.joints, self.tick - self.joints_late
        hil, joints = self.imu(tick), self._sample(taken)
        imu = self.imu(tick - self.imu_late) if self.imu_late else hil
        grip = None
        if joints is not None:
            ends = [6 + i * n for i in range(4)]
            if len(self._fingers.opening):
                grip = (taken * self.period, joints[ends[-1] :])
            joints = (taken * self.period, *(joints[i : i + n] for i in ends[:-1]))
        poses, payloads = map(self._mocap.arrived, (VEHICLE_POSE, PAYLOAD_POSE))
        payload = payloads[-1] if payloads else None
        samples = Samples(imu, joints, None, hil, payload=payload, grip=grip)
        samples.poses = poses
        return samples

    def imu(self, tick: int) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Return stamp [s], gyro and specific force (3,) of the sample taken at `tick`, a copy."""
        sample = self._sample(tick)
        return None if sample is None else (tick * self.period, sample[0:3], sample[3:6])

    def _sample(self, tick: int) -> np.ndarray | None:
        a, row = self.arrays, tick % len(self.arrays.samples)
        return a.samples[row].copy() if tick == a.taken.item(row) else None

    def step(self, motor_commands: np.ndarray, arm_command: np.ndarray, magnet: bool) -> None:
        if self.tick not in self._drawn:
            self.draw_noise()
        if self._hinge is not None:
            magnet = self._held_by_magnet(magnet)
        error = self._step(motor_commands, arm_command, magnet)
        self.effects.check()
        if error:
            raise self.failure(error)

    def failure(self, error: int) -> PhysicsError:
        """Return what a step says that returned `error`."""
        return failure(error, self.model)

    def disturb(self, disturbance: Disturbance) -> None:
        efficiency, friction, softness, gain = self._undisturbed
        model, dofs = self.model, self._arm_dofs
        self.rotors.efficiency[:] = efficiency * disturbance.rotor_parts
        self.effects.arrays.factor[:] = self.rotors.efficiency
        braked = disturbance.joint_friction > 0.0
        model.dof_frictionloss[dofs] = friction + disturbance.joint_friction
        model.dof_solimp[dofs, 0:2] = np.where(braked[:, None], STIFF, softness[:, 0:2])
        self.magnet_gain = gain * disturbance.magnet_part
        if self.vehicle.description.has_magnet:
            model.actuator_gainprm[model.actuator(MAGNET).id, 0] = self.magnet_gain
        change = disturbance.wind - self._added_wind
        self.wind += change
        self._wind_mean += change
        self._added_wind += change
        self._swing_rate = disturbance.payload_swing

    def open_to(self, opening: float) -> None:
        self._fingers.open_to(opening)

    def push(self, force: np.ndarray, torque: np.ndarray) -> None:
        self._push[:3], self._push[3:] = force, torque

    def _held_by_magnet(self, magnet: bool) -> bool:
        """Close or open the hinge; return whether the magnet acts.

        The closed hinge replaces the contact of magnet and payload.
        """
        hinge, rate = self._hinge, self._swing_rate
        if rate is not None and magnet and (hinge.closed or hinge.close(rate)):
            return False
        if hinge.closed:
            hinge.open()
        return magnet

    def truth(self) -> Truth:
        at, row = self.truth_row, np.empty(self.truth_row.width)
        self._write_truth(self.arrays.observed, self.magnet_gain, at, row)
        return Truth(
            row[: at.rotor_thrust].reshape(3, -1),
            self._quaternion.copy(),
            row[at.payload : at.payload + 3],
            row[at.payload + 3 : at.magnet],
            float(row[at.magnet]),
            float(row[at.magnet + 1]),
            self.rotors.speed.copy(),
            row[at.rotor_thrust : at.payload],
            row[at.grip :],
        )

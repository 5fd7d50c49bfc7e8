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
    PlantArrays,
    sense,
    step,
    write_truth,
)
from uam_sim_bridge.plant.physics import Body
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
    """Vehicle with arm, magnet and payload in MuJoCo; the numbers are in config/vehicle/."""

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
        start = np.array(arm_start or vehicle.description.stowed, dtype=float)
        plate, sensors = model.geom("payload_plate"), numbers["sensors"]

        scale = sensors["noise_scale"]
        imu_noise, mocap_noise, gusts, payload_noise = generators(seed, 4)
        self._imu = Imu(sensors["imu"], scale, imu_noise)
        noises, payload_top = (mocap_noise, payload_noise), float(plate.pos[2] + plate.size[2])
        self._mocap = Mocap(sensors["mocap"], scale, noises, payload_top)
        self.rotors = Rotors(numbers["rotors"], model.opt.timestep)
        self.servos = Servos(numbers["servos"], start)
        self._fingers = Fingers(model, data, numbers.get("gripper"))
        self._fingers.pace(self.period)
        air = numbers["air"]
        keep = np.exp(-self.period / air["gust_time"])
        self._gust = Noise(gusts, np.full(3, air["gust"] * np.sqrt(1.0 - keep**2)))
        self.body = self._lay_out(payload_mass, start, keep)  # never replaced, as `arrays`
        base = model.joint(BASE).dofadr[0]
        self._push = data.qfrc_applied[base : base + 6]

        mujoco.mj_forward(model, data)
        self.body.specific_force[:] = self.body.sensed_force
        self._drawn, self._observed = range(0), -1  # ticks that have noise, newest observed one
        self._added_wind = np.zeros(3)  # by disturbances
        self._swing_rate: float | None = None  # [rad/s] of a payload that hangs on the hinge
        self._hinge = PayloadHinge(model, data) if hinged else None
        bench = Bench(vehicle, model, data, self.rotors, self._mocap, self.body)
        self.effects = ActingEffects(numbers["effects"], bench, seed)
        self._unused_truth = np.empty(self.truth_row.width)
        self._prepare(air["gust"] > 0.0)
        self._arm_dofs = bench.arm
        self._undisturbed = (
            self.rotors.efficiency.copy(),
            model.dof_frictionloss[self._arm_dofs].copy(),
            model.dof_solimp[self._arm_dofs].copy(),
            self.magnet_gain,
        )

    def _lay_out(self, payload_mass: float, start: np.ndarray, gust_keep: float) -> Body:
        """Set the initial pose; return the arrays. start (n,) [rad]: joint angles."""
        data, model, described = self.data, self.model, self.vehicle.description
        joint, names = model.joint, described.joint_names
        self._in_a_row("joint", [joint(name).dofadr[0] for name in names])
        (base_q, base_v), (arm_q, arm_v), (payload_q, _) = (
            (joint(name).qposadr[0], joint(name).dofadr[0]) for name in (BASE, names[0], PAYLOAD)
        )
        arm = slice(arm_v, arm_v + self.joints)
        sensed = model.sensor("specific_force").adr[0]
        alpha, payload = data.qpos[arm_q:][: self.joints], data.qpos[payload_q : payload_q + 7]
        air = self.vehicle.numbers["air"]
        alpha[:] = start
        payload[0:2] += self.vehicle.numbers["variation"]["payload_offset"]
        if payload_mass <= 0.0:  # moved far away: the model stays the same
            payload[0:3] = (5.0, 5.0, 0.02)
        return Body(
            rotors=self.rotors.arrays,
            servos=self.servos.arrays,
            position=data.qpos[base_q : base_q + 3],
            quaternion=data.qpos[base_q + 3 : base_q + 7],
            velocity=data.qvel[base_v : base_v + 3],
            rates=data.qvel[base_v + 3 : base_v + 6],
            alpha=alpha,
            alpha_dot=data.qvel[arm],
            base_acceleration=data.qacc[base_v : base_v + 6],
            alpha_ddot=data.qacc[arm],
            sensed_force=data.sensordata[sensed : sensed + 3],
            specific_force=np.zeros(3),
            thrust_control=self._controls(described.rotor_names),
            torque_control=self._controls(names),
            force=data.xfrc_applied[model.body(BASE).id, 0:3],
            drag=np.array(air["drag"], dtype=float),
            wind=np.array(air["wind"], dtype=float),
            wind_mean=np.array(air["wind"], dtype=float),
            gust_keep=np.array([gust_keep]),
            payload=payload,
            # of the same instant as the face: qpos is a physics step later
            payload_centre=data.xpos[model.body(PAYLOAD).id],
            payload_axes=data.xmat[model.body(PAYLOAD).id],
            **self._magnet_arrays(-start.sum()),
            finger_ends=self._fingers.ends,
            finger_goal=self._fingers.goal,
            opening=self._fingers.opening,
            grip_force=self._fingers.force,
            imu_bias=self._imu.bias,
            encoder_units=encoder_units(self.vehicle.numbers["sensors"]["joints"]),
        )

    def _magnet_arrays(self, level: float) -> dict[str, np.ndarray]:
        """Return those of a magnet, which hangs at an angle [rad]; zeros without a magnet."""
        self.magnet_gain, model, data = 0.0, self.model, self.data
        if not self.vehicle.description.has_magnet:
            none = {"face": np.zeros(3), "gap_constants": NO_MAGNET}
            return none | {"magnet_control": np.zeros(1), "swing": np.zeros(1)}
        at, magnet = model.joint(SWING).qposadr[0], self.vehicle.numbers["magnet"]
        swing = data.qpos[at : at + 1]
        swing[:] = level
        self.magnet_gain = float(model.actuator(MAGNET).gainprm[0])
        return {
            "face": data.site_xpos[model.site(FACE).id],
            "gap_constants": magnet_constants(model, magnet["gap_scale"], magnet.get("curve", ())),
            "magnet_control": self._controls((MAGNET,)),
            "swing": swing,
        }

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
            *(self.body, self.truth_row),
            *(self._imu.noise.arrays, self._gust.arrays, self._mocap.arrays, self.effects.arrays),
            np.zeros((max(late) + 1, 8 + 3 * self.joints)),
            np.full(max(late) + 1, np.iinfo(np.int64).min),
            self.memory,
        )
        truth = self._unused_truth
        self._sense = bound(sense, a, truth)
        self._step = bound(step, a, motors, np.empty(self.joints), True)
        self._write_truth = prepared(write_truth, self.body, 1.0, a.truth, truth)

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
        self.body.wind[:] += change
        self.body.wind_mean[:] += change
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
        self._write_truth(self.body, self.magnet_gain, at, row)
        return Truth(
            row[: at.rotor_thrust].reshape(3, -1),
            self.body.quaternion.copy(),
            row[at.payload : at.payload + 3],
            row[at.payload + 3 : at.magnet],
            float(row[at.magnet]),
            float(row[at.magnet + 1]),
            self.rotors.speed.copy(),
            row[at.rotor_thrust : at.payload],
            row[at.grip :],
        )

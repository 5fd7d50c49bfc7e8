"""The plant's vehicle: numbers of the description, and the MuJoCo model made of MJCF and numbers.

The MJCF holds bodies, their masses and shapes, and the sites of the sensors. Rotors, actuators,
ranges of the joints and gravity are added from the description.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, TypeVar

import mujoco
import numpy as np

from uam_control.mission.scenarios.environment import ENVIRONMENT, default_environment
from uam_control.vehicle import (
    DEFAULT_VEHICLE,
    TWO_FINGER,
    Joint,
    VehicleDescription,
    VehicleError,
    load_description,
    model_spec,
)
from uam_sim_bridge.plant.arm_geometry import BASE, FACE, MAGNET, SWING
from uam_sim_bridge.plant.gripper import FINGERS, add_drive
from uam_sim_bridge.plant.surroundings import PAYLOAD, add_surroundings

T = TypeVar("T")
MASS_TOLERANCE = 1e-3  # relative
LOAD_BELOW = 0.0505  # [m] `variation.tip_mass` below the magnet's pivot: where a payload hangs


@dataclass
class Vehicle:
    """A description and the numbers of its file; a flight may change some numbers.

    The controllers use the description, the plant uses the numbers. The entry `effects` of the
    numbers are the effects of the plant, see `effects.presets`; `environment`: what stands around.
    """

    description: VehicleDescription
    numbers: dict[str, Any]

    @classmethod
    def load(cls, name_or_file: str = DEFAULT_VEHICLE) -> Vehicle:
        """Read a vehicle by name or file; raises VehicleError, ConfigurationError."""
        return cls.of(load_description(name_or_file))

    @classmethod
    def of(cls, description: VehicleDescription) -> Vehicle:
        """Return the vehicle as described, on a plant without effects, in the usual environment."""
        beside = {"effects": {}, ENVIRONMENT: default_environment()}
        return cls(description, beside | description.numbers)

    def changed(self, changes: dict[str, object]) -> Vehicle:
        """Return a copy with dotted entries replaced, e.g. {"air.gust": 1.0}.

        Raises VehicleError for an entry that is not there.
        """
        numbers = deepcopy(self.numbers)
        for dotted, value in changes.items():
            *parents, last = dotted.split(".")
            entry = numbers
            for parent in parents:
                entry = entry.get(parent) if isinstance(entry, dict) else None
            if not isinstance(entry, dict) or last not in entry:
                raise VehicleError(f"vehicle has no '{dotted}'")
            entry[last] = value
        return Vehicle(self.description, numbers)

    def compile(
        self, payload_mass: float, extend: Callable[[mujoco.MjSpec], None] | None = None
    ) -> mujoco.MjModel:
        """Return the MuJoCo model with a payload of payload_mass [kg] (0: far away, massless).

        extend: adds parts to the model that only some flights need. Raises VehicleError if the MJCF
        contradicts the description.
        """
        described = self.description
        spec = self._of_mujoco(lambda: model_spec(described))
        self._check_parts(spec)
        spec.option.gravity = (0.0, 0.0, -described.gravity)
        self._add_rotors(spec)
        for joint in described.joints:
            self._limit(spec, joint)
        self._add_actuators(spec)
        add_surroundings(spec, self.numbers[ENVIRONMENT], payload_mass)
        if extend is not None:
            extend(spec)
        model = self._of_mujoco(spec.compile)
        if extend is None:  # added parts may have a mass
            self._check_model(model)
        self._vary(model)
        return model

    def _of_mujoco(self, make: Callable[[], T]) -> T:
        """Return what MuJoCo makes; raise VehicleError in one line: the MJCF, MuJoCo's reason."""
        try:
            return make()
        except ValueError as error:
            reason = " ".join(str(error).removeprefix("Error: ").split())
            raise VehicleError(f"{self.description.model}: {reason}") from None

    def _check_parts(self, spec: mujoco.MjSpec) -> None:
        """Raise VehicleError if a part that the plant finds by name is not in the MJCF."""
        described = self.description
        joints = {joint.name for joint in spec.joints}
        body, swing, face = ((MAGNET,), (SWING,), (FACE,)) if described.has_magnet else ((), (), ())
        for kind, required, there in (
            ("body", (BASE, *body), {body.name for body in spec.bodies}),
            ("joint", (BASE, *swing, *described.joint_names), joints),
            ("site", ("imu", *face), {site.name for site in spec.sites}),
            ("geom", face, {g.name for g in spec.geoms}),
            ("sensor", ("specific_force", "body_rates"), {s.name for s in spec.sensors}),
        ):
            missing = [name for name in required if name not in there]
            if missing:
                raise VehicleError(f"{described.model}: no {kind} '{missing[0]}'")
        moved = FINGERS if described.gripper.kind == TWO_FINGER else swing
        strange = sorted(joints - {BASE, PAYLOAD, *moved, *described.joint_names})
        if SWING in strange:
            raise VehicleError(
                f"{described.model}: joint '{SWING}' is a magnet's, and {described.file.name} has "
                "no magnet: leave it out of the MJCF, too, or name it in gripper.instead_of"
            )
        if strange:
            raise VehicleError(
                f"{described.model}: joint '{strange[0]}' is not in {described.file.name}, "
                f"which has: {', '.join(described.joint_names)}"
            )
        if spec.actuators:
            raise VehicleError(
                f"{described.model}: actuator '{spec.actuators[0].name}': actuators come from "
                f"{described.file.name}"
            )

    def _add_rotors(self, spec: mujoco.MjSpec) -> None:
        """Add a site and a propeller to the base for each rotor."""
        base, look = spec.body(BASE), spec.find_default("rotor")
        described = self.description
        for rotor in described.rotors:
            base.add_site(look, name=rotor.name, pos=rotor.position)
        for rotor in described.rotors:
            propeller = base.add_geom(look, pos=rotor.position)
            propeller.size[0] = described.rotor.radius

    def _limit(self, spec: mujoco.MjSpec, joint: Joint) -> None:
        """Set the range of a joint; raise VehicleError if the MJCF has another range."""
        element = spec.joint(joint.name)
        scale = 180.0 / math.pi if spec.compiler.degree else 1.0
        limits = [round(scale * limit, 9) for limit in (joint.low, joint.high)]
        stated = element.range.tolist()
        if any(stated) and not np.allclose(stated, limits):
            raise VehicleError(
                f"{self.description.model}: joint '{joint.name}' has the range {stated}, "
                f"{self.description.file.name} has {limits}"
            )
        element.range = limits

    def _add_actuators(self, spec: mujoco.MjSpec) -> None:
        """Add actuators: thrust [N] per rotor, torque [N m] per joint, magnet pull 0..1."""
        described = self.description
        for rotor in described.rotors:
            motor = spec.add_actuator(
                name=rotor.name, target=rotor.name, trntype=mujoco.mjtTrn.mjTRN_SITE
            )
            motor.set_to_motor()
            # the reaction torque on the base is opposite to the rotation: -z for counter-clockwise
            turn = -1.0 if rotor.counter_clockwise else 1.0
            motor.gear = (0.0, 0.0, 1.0, 0.0, 0.0, turn * described.rotor.moment_ratio)
        for name in described.joint_names:
            motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_motor()
        if described.gripper.kind == TWO_FINGER:
            add_drive(spec, self.numbers["gripper"])
        if not described.has_magnet:
            return
        magnet = spec.add_actuator(
            name=MAGNET, target=MAGNET, trntype=mujoco.mjtTrn.mjTRN_BODY, ctrlrange=(0.0, 1.0)
        )
        magnet.set_to_adhesion(self.numbers["magnet"]["holding_force"])

    def _check_model(self, model: mujoco.MjModel) -> None:
        """Raise VehicleError if mass or time step contradict the description."""
        described = self.description
        mass = float(model.body_subtreemass[model.body(BASE).id])
        if not math.isclose(mass, described.mass, rel_tol=MASS_TOLERANCE):
            raise VehicleError(
                f"{described.model}: the bodies weigh {mass:.4g} kg in all, "
                f"{described.file.name} has mass: {described.mass:g}"
            )
        step = model.opt.timestep
        steps = described.control_period / step if step > 0.0 else 0.0
        if round(steps) < 1 or not math.isclose(steps, round(steps), rel_tol=1e-9):
            raise VehicleError(
                f"{described.model}: timestep {model.opt.timestep:g} s does not divide "
                f"control_period of {described.file.name}, {described.control_period:g} s"
            )

    def _vary(self, model: mujoco.MjModel) -> None:
        """Change masses, inertias and centres of mass as `variation` says."""
        variation = self.numbers["variation"]
        offset, load = variation.get("base_offset", (0.0, 0.0)), variation.get("tip_mass", 0.0)
        mass, inertia = variation["mass"], variation["inertia"]
        if mass == inertia == 1.0 and not (any(offset) or load):
            return
        vary(model, (mass, mass), (inertia, inertia), offset)
        if load:
            if not self.description.has_magnet:
                raise VehicleError(
                    f"{self.description.file}: variation.tip_mass: {load:g} kg hang on the magnet; "
                    "this vehicle has none: 0"
                )
            _add_point_mass(model, model.body(MAGNET).id, load, LOAD_BELOW)
            mujoco.mj_setConst(model, mujoco.MjData(model))


def vary(
    model: mujoco.MjModel,
    masses: tuple[float, float],
    inertias: tuple[float, float],
    offset: Sequence[float],
) -> None:
    """Multiply the masses of base and arm, and further their inertias; move the centre of mass of
    the base by `offset` [m], x y or x y z."""
    base = model.body(BASE).id
    own = model.body_rootid == base
    mass = np.where(np.arange(model.nbody) == base, masses[0], masses[1])[own]
    inertia = np.where(np.arange(model.nbody) == base, inertias[0], inertias[1])[own]
    model.body_mass[own] *= mass
    model.body_inertia[own] *= (mass * inertia)[:, None]
    model.body_ipos[base][: len(offset)] += offset
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _add_point_mass(model: mujoco.MjModel, body: int, mass: float, below: float) -> None:
    """Add a point mass [kg] to a body, `below` its origin [m], on the vertical axis of its mass."""
    own, height = model.body_mass[body], model.body_ipos[body][2]
    distance = height + below
    model.body_mass[body] = own + mass
    model.body_ipos[body][2] = height - distance * mass / (own + mass)
    model.body_inertia[body][:2] += own * mass / (own + mass) * distance**2

"""All effects by name. A new one is a file beside this one and a line in KINDS."""

from uam_sim_bridge.plant.effects.arm_occlusion import ArmOcclusion
from uam_sim_bridge.plant.effects.battery_sag import BatterySag
from uam_sim_bridge.plant.effects.cable_torque import CableTorque
from uam_sim_bridge.plant.effects.downwash import Downwash
from uam_sim_bridge.plant.effects.effect import Effect
from uam_sim_bridge.plant.effects.ground_effect import GroundEffect
from uam_sim_bridge.plant.effects.joint_gear import JointGear
from uam_sim_bridge.plant.effects.joint_readings import JointReadings
from uam_sim_bridge.plant.effects.mismatches import (
    MassMismatch,
    MocapFeed,
    RotorMismatch,
    RotorSpread,
)
from uam_sim_bridge.plant.effects.mocap_dropouts import MocapDropouts
from uam_sim_bridge.plant.effects.mocap_jitter import MocapJitter
from uam_sim_bridge.plant.effects.network_delay import NetworkDelay
from uam_sim_bridge.plant.effects.odometry_drift import OdometryDrift
from uam_sim_bridge.plant.effects.propeller_vibration import PropellerVibration
from uam_sim_bridge.plant.effects.servo_noise import ServoNoise
from uam_sim_bridge.plant.effects.standing_load import StandingLoad
from uam_sim_bridge.plant.effects.thrust_fade import ThrustFade

# in this order they change a sample one after another
KINDS: tuple[type[Effect], ...] = (
    PropellerVibration,
    MassMismatch,
    StandingLoad,
    RotorMismatch,
    RotorSpread,
    BatterySag,
    ThrustFade,
    GroundEffect,
    Downwash,
    ServoNoise,
    JointGear,
    JointReadings,
    CableTorque,
    MocapFeed,
    ArmOcclusion,
    MocapJitter,
    MocapDropouts,
    OdometryDrift,
    NetworkDelay,
)
EFFECTS: dict[str, type[Effect]] = {kind.NAME: kind for kind in KINDS}

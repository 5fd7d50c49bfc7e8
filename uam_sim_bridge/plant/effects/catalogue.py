"""All effects by name. A new one is a class of a file beside this one and a line in KINDS."""

from uam_sim_bridge.plant.effects import joint_effects, load_effects, pose_effects, rotor_effects
from uam_sim_bridge.plant.effects.arm_occlusion import ArmOcclusion
from uam_sim_bridge.plant.effects.effect import Effect
from uam_sim_bridge.plant.effects.network_delay import NetworkDelay

# in this order they change a sample one after another
KINDS: tuple[type[Effect], ...] = (
    rotor_effects.PropellerVibration,
    load_effects.MassMismatch,
    load_effects.StandingLoad,
    rotor_effects.RotorMismatch,
    rotor_effects.RotorSpread,
    rotor_effects.BatterySag,
    rotor_effects.ThrustFade,
    rotor_effects.GroundEffect,
    load_effects.Downwash,
    joint_effects.ServoNoise,
    joint_effects.JointGear,
    joint_effects.JointReadings,
    joint_effects.CableTorque,
    pose_effects.MocapFeed,
    ArmOcclusion,
    pose_effects.MocapJitter,
    pose_effects.MocapDropouts,
    pose_effects.OdometryDrift,
    NetworkDelay,
)
EFFECTS: dict[str, type[Effect]] = {kind.NAME: kind for kind in KINDS}

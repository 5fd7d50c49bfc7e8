"""Names of the nodes."""

ESTIMATOR, MISSION = "state_estimator", "mission"
POSITION, ATTITUDE, ARM = "position_controller", "attitude_controller", "arm_controller"
BRIDGE, PLANT, RECORDER = "mavlink_bridge", "mujoco_sim", "recorder"
MOCAP_DRIVER, ARM_DRIVER, MAGNET_DRIVER = "mocap_driver", "arm_driver", "magnet_driver"
SCENE, COCKPIT = "scene", "cockpit"  # observers of no wire: a flight starts without them
CHECKLIST = "checklist"  # of a real vehicle only
# Nodes that one process may have, in the order in which they act in a tick; and its own node
FUSED = (ESTIMATOR, MISSION, POSITION, ATTITUDE, ARM, BRIDGE)
FLIGHT_CONTROLLER = "flight_controller"
# Those of a law of the whole body are one process
CONTROLLERS, WHOLE_BODY = (POSITION, ATTITUDE, ARM), "whole_body_controller"
FLIGHT = "uam_fly"  # the node of `uam fly` itself

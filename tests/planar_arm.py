"""Parameters of an arm of point masses that hangs straight down and turns about the body's -y."""


def planar_arm(masses, centres, lengths):
    """masses [kg], centres and lengths [m]: of each link from its joint; joint 1 at the origin."""
    count, zeros = len(masses), [0.0] * len(masses)
    return {
        "joint_offsets": [x for d in (0.0, *lengths[:-1]) for x in (0.0, 0.0, -d)],
        "joint_axes": [0.0, -1.0, 0.0] * count,
        "link_masses": list(masses),
        "link_centres": [x for d in centres for x in (0.0, 0.0, -d)],
        "link_inertias": [0.0] * (6 * count),
        "joint_armature": zeros,
        "joint_damping": zeros,
        "joint_friction": zeros,
        "hand_place": [0.0, 0.0, -lengths[-1]],
    }

"""Whether a PX4 to test with is pointed at."""

import os

from uam_sim_bridge.px4.px4_installation import VARIABLE, Px4Error, Px4Installation

NO_PX4 = f"no PX4 to fly with: set {VARIABLE} to a build of PX4 v1.16 SITL" + (
    f" ({os.environ[VARIABLE]} is none)" if os.environ.get(VARIABLE) else ""
)


def installation() -> Px4Installation | None:
    """The PX4 that the environment names, None where there is none."""
    try:
        return Px4Installation.find()
    except Px4Error:
        return None

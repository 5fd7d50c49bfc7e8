"""Where a loop of steady ticks ends."""

from __future__ import annotations

from uam_control.stages.control_tick import STAGES

# before a stage of `STAGES`
LISTEN, ESTIMATE, MISSION, LAWS, _, _, BRIDGE, REFERENCE = range(len(STAGES))
# before what follows them; WATCH: as RECORD, but the executive of the grasps is due first; END:
# between two ticks; BLIND: after the estimator, which gives no state; ERROR: of MuJoCo
RECORD, AUTOPILOT, WATCH, END, BLIND, ERROR = range(len(STAGES), len(STAGES) + 6)

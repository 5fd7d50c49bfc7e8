"""Grasp and release of the payload: windows, alignment, evidence, attempts, decisions."""

from uam_control.grasp.directive import Grasp, GraspDecision
from uam_control.grasp.executive import GraspExecutive
from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import Sight
from uam_control.grasp.windows import GraspWindow, grasp_windows

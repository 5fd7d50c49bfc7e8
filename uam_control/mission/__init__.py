"""Missions: scenarios, smooth references, and the sequence of a flight from waiting to landed."""

from uam_control.mission.feasibility import Feasibility, InfeasibleReference
from uam_control.mission.mission import Mission
from uam_control.mission.mission_parameters import MissionParameters, StartParameters
from uam_control.mission.pre_arm import ChecklistReport
from uam_control.mission.scenarios.scenario import Scenario, ScenarioError
from uam_control.mission.scenarios.scenario_files import load_scenario
from uam_control.mission.scenarios.scenario_options import ScenarioOptions

"""Supervision of a flight: limits, states, and the reaction of the vehicle in each state."""

from uam_control.settings.preflight_check import PreflightCheck
from uam_control.supervision.inputs import Inputs
from uam_control.supervision.observation import Authority, Observation, OperatorCommand, Readings
from uam_control.supervision.preflight import preflight
from uam_control.supervision.states import ORDINARY, Decision, Event, Guide, State, StateTransition
from uam_control.supervision.supervision_parameters import SupervisionParameters
from uam_control.supervision.supervisor import Supervisor

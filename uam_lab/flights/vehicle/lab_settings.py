"""The settings of a flight in a laboratory: those of `uam fly`, on the wall clock."""

from __future__ import annotations

from uam_control.laws import catalogue
from uam_control.profiles.profile import BRIDGE, NODES, load_profile
from uam_lab.flights import flight_settings
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.node_options import FLIGHT_CONTROLLER
from uam_lab.flights.vehicle.lab import Lab

SHARED = (
    *NODES,
    BRIDGE,
    "recorder",
    "cockpit",
    FLIGHT_CONTROLLER,
)  # nodes that a flight in simulation has, too


def settings_of(lab: Lab, command: str = "", dry_run: bool = False) -> FlightSettings:
    """Return the checked settings; the room is the supervisor's geofence.

    The scenario must be feasible within the room from a take-off at its origin. The mission waits
    for the command start. Raises what `flight_settings.settings` raises.
    """
    given = {node: values for node, values in lab.nodes.items() if node in SHARED}
    fence = {"geofence_low": list(lab.room.low), "geofence_high": list(lab.room.high)}
    given["mission"] = given.get("mission", {}) | fence
    law = catalogue.DEFAULT
    if lab.profile:
        law = load_profile(*lab.profile, vehicle=lab.vehicle).laws()["position_controller"]
    return flight_settings.settings(
        scenario=lab.scenario,
        profile=list(lab.profile) or None,
        controller=law,
        vehicle=lab.vehicle.source,
        clock="realtime",
        imu=lab.imu,
        autopilot=lab.autopilot,
        gcs=lab.gcs,
        auto_start=False,
        dry_run=dry_run,
        view=True,
        parameters=given,
        process=lab.process,
        command=command,
        fused=lab.fused,
    )

"""`uam fly --engine direct`: one flight of the direct engine, with progress and outcome."""

from __future__ import annotations

import time

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.maths.rotations import wrap_angle
from uam_lab.flight.direct.flight import DirectFlight
from uam_lab.flight.direct.warm_up import is_cold, warm_up
from uam_lab.flight.flight_settings import FlightSettings
from uam_lab.flight.progress import Progress, Status
from uam_lab.processes.interrupts import Interrupts
from uam_lab.results.outcome import Outcome, transitions
from uam_lab.results.result_folder import ResultFolder
from uam_sim_bridge.plant import Vehicle


def fly(settings: FlightSettings, folder: ResultFolder, progress: Progress) -> Outcome:
    """Fly until the mission is done or the user interrupts."""
    if is_cold():
        progress.message("compiling the control path (once)")
        warm_up()
    vehicle = Vehicle.of(settings.vehicle).changed(settings.vehicle_changes)
    flight = DirectFlight(
        settings.scenario,
        settings.profile,
        vehicle,
        settings.payload_mass,
        settings.seed,
        settings.faults,
        settings.plant,
    )
    folder.write_parameters({node: vars(values) for node, values in settings.profile.sets.items()})
    begin = time.monotonic()
    with Interrupts() as stop:
        try:
            flight.run(lambda *_: _report(flight, begin, progress, stop))
        except _Stopped:
            pass
    output = flight.mission.output
    return Outcome(
        series=flight.recording.series() if flight.recording.count else None,
        wall_s=time.monotonic() - begin,
        abort_reason=output.abort_reason,
        failure=flight.ended_by,
        interrupted=stop.raised and not output.done,
        transitions=transitions(flight.mission.changes),
        faults=flight.fault_records,
    )


class _Stopped(Exception):
    """The user interrupted the flight."""


def _report(flight: DirectFlight, begin: float, progress: Progress, stop: Interrupts) -> None:
    """Show where the flight is; called once a simulated second. Raises _Stopped."""
    if stop.raised:
        raise _Stopped
    recording = flight.recording
    if not recording.count:
        return
    row, output = recording.values[recording.count - 1], flight.mission.output
    columns = recording.columns
    size = columns.size
    error = row[columns.block("estimate.")][:size] - row[columns.block("reference.")][:size]
    error[ATTITUDE.start :] = wrap_angle(error[ATTITUDE.start :])
    norms = [float(np.linalg.norm(error[part])) for part in (POSITION, ATTITUDE, ARM)]
    wall = time.monotonic() - begin
    progress.update(
        Status(
            phase=output.phase,
            time=output.time,
            position_error=norms[0] * output.flying,
            attitude_error=norms[1] * output.flying,
            arm_error=norms[2],
            real_time_factor=flight.plant.time / wall if wall > 0.0 else 0.0,
        )
    )

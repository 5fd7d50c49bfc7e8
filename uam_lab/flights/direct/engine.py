"""One flight of the direct engine, with progress and outcome."""

import time

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.maths.rotations import tilt, wrap_angle
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.flight_settings import AUTOPILOT_IMU, FlightSettings
from uam_lab.flights.observer import FlightStatus, Observer
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder
from uam_sim_bridge.plant import Vehicle


def fly(
    settings: FlightSettings, folder: ResultFolder, observer: Observer, stop: StopRequest
) -> Outcome:
    """Fly until the mission is done or a stop is requested."""
    observer.started(None)
    vehicle = Vehicle.of(settings.vehicle).changed(settings.vehicle_changes)
    flight = DirectFlight(
        settings.scenario,
        settings.profile,
        vehicle,
        settings.payload_mass,
        settings.seed,
        settings.faults,
        settings.plant,
        settings.imu == AUTOPILOT_IMU,
    )
    flight.say = observer.message
    folder.write_parameters({node: vars(values) for node, values in settings.profile.sets.items()})
    begin = time.monotonic()

    def report(_: float, __: str) -> bool:
        """Show where the flight is; return whether it ends."""
        if not stop.raised and flight.recording.count:
            observer.update(_status(flight, time.monotonic() - begin))
        return stop.raised

    flight.run(report)
    wall, interrupted = time.monotonic() - begin, stop.raised and not flight.mission.output.done
    return flight.outcome(wall_s=wall, interrupted=interrupted)


def _status(flight: DirectFlight, wall: float) -> FlightStatus:
    """Return where the flight is; wall [s]: since its begin."""
    recording = flight.recording
    row, output = recording.values[recording.count - 1], flight.mission.output
    columns = recording.columns
    size = columns.size
    estimate = row[columns.block("estimate.")][:size]
    error = estimate - row[columns.block("reference.")][:size]
    error[ATTITUDE.start :] = wrap_angle(error[ATTITUDE.start :])
    norms = [float(np.linalg.norm(error[part])) for part in (POSITION, ATTITUDE, ARM)]
    return FlightStatus(
        phase=output.phase,
        time=output.time,
        position_error=norms[0] * output.flying,
        attitude_error=norms[1] * output.flying,
        tilt=tilt(estimate[ATTITUDE]),
        arm_error=norms[2],
        real_time_factor=flight.plant.time / wall if wall > 0.0 else 0.0,
    )

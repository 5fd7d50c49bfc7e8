"""Values of the link and of the autopilot's health for /diagnostics."""

from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.telemetry.vitals import ESTIMATOR_FLAGS, estimate_faults, names


def report(link: OffboardLink) -> dict[str, str | int | None]:
    """Return the values by name; None before the first message with the value."""
    vitals, sync = link.vitals, link.time_sync
    flags, battery = vitals.estimator_flags, vitals.battery
    return {
        "round trip [ms]": _scaled(sync.round_trip, 1e3, ".1f"),
        "clock offset [ms]": _scaled(sync.offset, 1e3, ".1f"),
        "messages [1/s]": f"{link.statistics.rate:.0f}",
        "messages lost": link.lost,
        "bad bytes": link.framer.bad_bytes,
        "reboots of the autopilot": link.reboots,
        "estimator": None if flags is None else ", ".join(names(flags, ESTIMATOR_FLAGS)),
        "sensors unhealthy": ", ".join(vitals.unhealthy),
        "autopilot load [%]": _scaled(vitals.load, 100.0, ".0f"),
        "battery [V]": f"{battery.voltage:.2f}" if battery and battery.known else None,
    }


def faults(link: OffboardLink) -> tuple[str, ...]:
    """Return one text per fault of the autopilot's estimate; () while it is disarmed."""
    if not link.armed or link.vitals.estimator_flags is None:
        return ()
    return tuple(f"autopilot: {fault}" for fault in estimate_faults(link.vitals.estimator_flags))


def _scaled(value: float | None, scale: float, form: str) -> str | None:
    return None if value is None else format(scale * value, form)

"""Checks of the autopilot: the one at a link, and an installation of PX4 in software."""

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

from uam_control.offboard.firmware import FIRMWARES, Firmware
from uam_control.offboard.modes import MavCmd
from uam_lab.preflight.doctor.finding import Finding, fail, ok, warn
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message, mavlink2
from uam_sim_bridge.mavlink.telemetry.parameter_check import ParameterReader, request
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE, RequiredParameters
from uam_sim_bridge.mavlink.transport.transport import Transport, open_transport
from uam_sim_bridge.ports import PortError
from uam_sim_bridge.px4.px4_installation import VARIABLE, Px4Error, Px4Installation

PATIENCE = 5.0  # [s] for a heartbeat (sent once per second), and for one more parameter
VERSION_PATIENCE = 2.0  # [s] for AUTOPILOT_VERSION after it
BEAT, POLL = 0.5, 0.01  # [s]
USUAL_SYSTEM = 1  # that the bridge speaks to, without autopilot_system
OWN_SYSTEM = 254  # system id: unused, a ground station has 255, autopilots count from 1
RELEASES = ((255, ""), (192, " rc"), (128, " beta"), (64, " alpha"), (0, " dev"))


@dataclass
class Heard:
    """Messages received over a link. heartbeat: newest of the autopilot; system: its id."""

    heartbeat: Message | None = None
    system: int = 0
    version: Message | None = None
    bytes: int = 0
    others: set[str] = field(default_factory=set)  # message types of other senders


def checks(url: str = "") -> Iterator[Finding]:
    """Yield the findings about PX4 in software and, with `url`, about the autopilot there."""
    yield px4()
    if url:
        yield from link(url)


def px4(directory: str | None = None) -> Finding:
    """Check for a PX4 for `--autopilot px4` in PX4_SITL_DIR or `directory`."""
    given = directory or os.environ.get(VARIABLE, "")
    if not given:
        return ok("PX4", f"{VARIABLE} is not set; only --autopilot px4 needs it")
    try:
        return ok("PX4", f"{VARIABLE}: {Px4Installation.find(given).directory}")
    except Px4Error as error:
        return warn(
            "PX4", str(error), f"build PX4, or unset {VARIABLE}: other flights do not need it"
        )


def link(url: str, patience: float = PATIENCE, parameters: float = PATIENCE) -> Iterator[Finding]:
    """Check for an autopilot at `url`, for at most `patience` [s], and yield the finding.

    If it is a PX4, yield one finding per parameter that a vehicle needs; parameters [s]: without a
    further answer.
    """
    try:
        transport = open_transport(url)
    except PortError as error:
        yield fail("autopilot", str(error), "give another URL, or end the program that uses it")
        return
    try:
        heard = listen(transport, patience)
        if heard.heartbeat is None:
            yield _silent(url, heard, patience)
            return
        yield describe(url, heard)
        spoken = _spoken(heard.heartbeat)
        if spoken is not None:
            rules = RequiredParameters.read(VEHICLE, spoken)
            reader = ParameterReader(rules, as_bytes=spoken.integers_as_bytes)
            values = read_parameters(transport, _codec(), heard.system, reader, parameters)
            yield from parameter_findings(values, rules)
    finally:
        transport.close()


def _spoken(heartbeat: Message) -> Firmware | None:
    """Return the firmware of a heartbeat; None for one that is not in FIRMWARES."""
    of_kind = (one for one in FIRMWARES.values() if one.autopilot == heartbeat.autopilot)
    return next(of_kind, None)


def _codec() -> Codec:
    return Codec(OWN_SYSTEM, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER)


def listen(transport: Transport, patience: float) -> Heard:
    """Send heartbeats, wait for the heartbeat of an autopilot, then request its version."""
    codec = _codec()
    framer, heard = Framer(codec), Heard()
    end, beat = time.monotonic() + patience, 0.0
    while (now := time.monotonic()) < end and heard.version is None:
        if now >= beat:  # a UDP peer gets the address from it
            beat = now + BEAT
            transport.send(codec.encode(_heartbeat()))
            if heard.heartbeat is not None:
                transport.send(codec.encode(_request(heard.system)))
        met = heard.heartbeat is not None
        for data in transport.receive():
            heard.bytes += len(data)
            for message in framer.take(data, transport.stream):
                _take(heard, message)
        if heard.heartbeat is not None and not met:
            end, beat = now + VERSION_PATIENCE, 0.0
        time.sleep(POLL)
    return heard


def _take(heard: Heard, message: Message) -> None:
    kind, system = message.get_type(), message.get_srcSystem()
    autopilot = kind == "HEARTBEAT" and message.autopilot != mavlink2.MAV_AUTOPILOT_INVALID
    if autopilot and heard.system in (0, system):
        heard.heartbeat, heard.system = message, system
    elif kind == "AUTOPILOT_VERSION" and system == heard.system:
        heard.version = message
    elif heard.heartbeat is None:
        heard.others.add(kind)


def describe(url: str, heard: Heard) -> Finding:
    """Return the finding about the autopilot that answered."""
    beat = heard.heartbeat
    kind = _name("MAV_AUTOPILOT", beat.autopilot)
    armed = "armed" if beat.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED else "disarmed"
    spoken = _spoken(beat)
    mode = f"{beat.custom_mode}" if spoken is None else spoken.mode(beat.custom_mode).name
    number = version(heard.version.flight_sw_version) if heard.version else "version not sent"
    found = (
        f"{url}: system {heard.system}, {kind}, {_name('MAV_TYPE', beat.type)}, mode {mode}, "
        f"{armed}, firmware {number}"
    )
    if spoken is None:
        hint = f"the bridge speaks {', '.join(FIRMWARES)}: docs/autopilot.md"
        return warn("autopilot", found, hint)
    if armed == "armed":
        return warn("autopilot", f"{found}: ARMED", "mind the propellers; disarm before a flight")
    if heard.system != USUAL_SYSTEM:
        advice = f"lab file: autopilot_system: {heard.system}; or set its MAV_SYS_ID to 1"
        return warn("autopilot", found, advice)
    return ok("autopilot", found)


def version(number: int) -> str:
    """Return AUTOPILOT_VERSION.flight_sw_version as text, as "1.16.0" or "1.15.0 beta"."""
    major, minor, patch, kind = number.to_bytes(4, "big")
    release = next(word for least, word in RELEASES if kind >= least)
    return f"{major}.{minor}.{patch}{release}"


def _silent(url: str, heard: Heard, patience: float) -> Finding:
    if heard.others:
        found = f"messages ({', '.join(sorted(heard.others)[:4])}), but no autopilot heartbeat"
        advice = "check what is connected: a camera, a radio, a ground station?"
    elif heard.bytes:
        found = f"{heard.bytes} bytes, but no MAVLink"
        advice = "check the baud rate, and that the port is set to MAVLink (MAV_0_CONFIG ...)"
    else:
        found = "nothing"
        advice = "check power, port number, firewall, and other programs that use the port"
    return fail("autopilot", f"{url}: {found} within {patience:g} s", advice)


def _name(table: str, value: int) -> str:
    """Return the name of a MAVLink constant, as "px4" for MAV_AUTOPILOT 12."""
    entry = mavlink2.enums[table].get(value)
    text = entry.name if entry is not None else f"{table}_{value}"
    return text.removeprefix(f"{table}_").lower().replace("_", " ")


def _heartbeat() -> Message:
    return mavlink2.MAVLink_heartbeat_message(
        mavlink2.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink2.MAV_AUTOPILOT_INVALID,
        *(0, 0, mavlink2.MAV_STATE_ACTIVE, 3),
    )


def _request(system: int) -> Message:
    version, component = mavlink2.MAVLINK_MSG_ID_AUTOPILOT_VERSION, mavlink2.MAV_COMP_ID_AUTOPILOT1
    return mavlink2.MAVLink_command_long_message(
        system, component, MavCmd.REQUEST_MESSAGE, 0, version, *[0] * 6
    )


def read_parameters(
    transport: Transport,
    codec: Codec,
    system: int,
    reader: ParameterReader,
    patience: float,
) -> dict[str, float]:
    """Return the values that `reader` asks of the autopilot `system`, as far as it answers.

    patience [s]: without a further answer.
    """
    framer = Framer(codec)
    progress = time.monotonic()
    while not reader.complete and (now := time.monotonic()) < progress + patience:
        for name in reader.due(now):
            transport.send(codec.encode(request(name, system)))
        for data in transport.receive():
            for message in framer.take(data, transport.stream):
                of_system = message.get_srcSystem() == system
                if of_system and message.get_type() == "PARAM_VALUE" and reader.take(message):
                    progress = now
        time.sleep(POLL)
    return reader.values


def parameter_findings(values: dict[str, float], rules: RequiredParameters) -> Iterator[Finding]:
    """Yield one line per required parameter, as a table: name, value, required value."""
    for name, rule in rules.items():
        value = values.get(name)
        text = "not answered" if value is None else f"{value:.9g}"
        found = f"{text}, {rule.required} required on a vehicle"
        if value is not None and rule.met(value):
            yield ok(name, found)
        else:
            yield warn(name, found, rule.why)

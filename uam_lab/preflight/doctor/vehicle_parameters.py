"""Check of the parameters that a real vehicle needs, over a link to its autopilot: only reads."""

from __future__ import annotations

import time
from collections.abc import Iterator

from uam_lab.preflight.doctor.finding import Finding, ok, warn
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer
from uam_sim_bridge.mavlink.telemetry.parameter_reader import ParameterReader, request
from uam_sim_bridge.mavlink.telemetry.required_parameters import RequiredParameters
from uam_sim_bridge.mavlink.transport.transport import Transport

PATIENCE = 5.0  # [s] without a further answer
POLL = 0.01  # [s]


def read(
    transport: Transport,
    codec: Codec,
    system: int,
    reader: ParameterReader,
    patience: float = PATIENCE,
) -> dict[str, float]:
    """Return the values that `reader` asks of the autopilot `system`, as far as it answers."""
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


def findings(values: dict[str, float], rules: RequiredParameters) -> Iterator[Finding]:
    """Yield one line per required parameter, as a table: name, value, required value."""
    for name, rule in rules.items():
        value = values.get(name)
        text = "not answered" if value is None else f"{value:.9g}"
        found = f"{text}, {rule.required} required on a vehicle"
        if value is not None and rule.met(value):
            yield ok(name, found)
        else:
            yield warn(name, found, rule.why)

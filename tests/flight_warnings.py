"""Warnings and errors in the log of a flight."""

from rosbags.highlevel import AnyReader

# on the ground the autopilot refuses to disarm until it has detected the landing
AT_THE_END = "disarming"


def warnings(folder):
    """Return [(time, node, text)] of warnings and errors: on /diagnostics, in the log."""
    reported, logged = [], []
    for time, name, level, text in statuses(folder):
        if level in (1, 2) and AT_THE_END not in text:
            reported.append((time, name, text))
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages(_of(reader, "/rosout")):
            message = reader.deserialize(data, connection.msgtype)
            if message.level >= 30:
                logged.append((time, message.name, message.msg))
    return reported, logged


def staying(folder, apart=()):
    """Return node → text of those whose last report is a warning or error; apart: texts to omit."""
    last = {name: (level, text) for _, name, level, text in statuses(folder)}
    return {
        name: text
        for name, (level, text) in last.items()
        if level in (1, 2) and not any(words in text for words in (AT_THE_END, *apart))
    }


def statuses(folder):
    """Return (time, node, level, text) of all reports on /diagnostics, in order."""
    return [(time, s.name, s.level, s.message) for time, s in _reports(folder)]


def last_values(folder, node):
    """Return the values of a node's last report on /diagnostics, by name."""
    last = [status for _, status in _reports(folder) if status.name == node][-1]
    return {pair.key: pair.value for pair in last.values}


def stamps(folder, topic):
    """Return the stamps [s] of a topic's messages, in order."""
    with AnyReader([folder]) as reader:
        headers = [
            reader.deserialize(data, connection.msgtype).header
            for connection, _, data in reader.messages(_of(reader, topic))
        ]
    return [header.stamp.sec + 1e-9 * header.stamp.nanosec for header in headers]


def _reports(folder):
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages(_of(reader, "/diagnostics")):
            message = reader.deserialize(data, connection.msgtype)
            yield from ((time, status) for status in message.status)


def _of(reader, topic):
    return [connection for connection in reader.connections if connection.topic == topic]

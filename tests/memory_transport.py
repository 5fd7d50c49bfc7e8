"""A transport in memory, for a link and what answers it in one process."""


class Memory:
    """A transport of two lists: `to_autopilot`, `to_link`."""

    stream, connected, dropped = False, True, 0

    def __init__(self):
        self.to_autopilot, self.to_link = [], []

    def send(self, data):
        self.to_autopilot.append(data)

    def receive(self):
        arrived, self.to_link = self.to_link, []
        return arrived

    def close(self):
        pass

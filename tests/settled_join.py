"""A join of stamps as in a node whose loop is never late."""

from uam_msgs_py.node.joins import StampJoin


class SettledJoin(StampJoin):
    """Settles after each message."""

    def add(self, name, stamp, value):
        super().add(name, stamp, value)
        self.settle()

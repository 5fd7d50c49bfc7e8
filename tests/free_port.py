"""A free port for a test."""

import socket


def free_port(kind: socket.SocketKind) -> int:
    """Return a free port of this machine; kind: SOCK_STREAM or SOCK_DGRAM."""
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]

"""The place of a killed node stays occupied."""

import socket

from uam_sim_bridge.flight.places import Places
from uam_sim_bridge.flight.ports import discovery_port, in_use

DOMAIN = 100  # no flight's; see flight/ports.py


def taken():
    return [n for n in range(6) if in_use(socket.SOCK_DGRAM, discovery_port(DOMAIN, n))]


def test_the_lowest_that_is_free_is_taken_and_let_go_at_the_end():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", discovery_port(DOMAIN, 1)))
        with Places(DOMAIN) as places:
            for _ in range(3):
                places.occupy()
            assert taken() == [0, 1, 2, 3]
        assert taken() == [1]

"""The address at which the simulator waits for an autopilot."""

import socket

import pytest
from free_port import free_port

from uam_sim_bridge.mavlink.hil.hil_server import HilServer, open_only_here
from uam_sim_bridge.ports import PortError


@pytest.mark.parametrize(
    ("address", "reached"), [("127.0.0.1", False), ("127.0.0.2", True), ("0.0.0.0", True)]
)
def test_the_port_is_open_at_its_address_only(address, reached):
    port = free_port()
    server = HilServer(port, 4, address)
    try:
        with socket.socket() as autopilot:
            autopilot.settimeout(5.0)
            assert (autopilot.connect_ex(("127.0.0.2", port)) == 0) is reached
            assert server.accept(1.0 if reached else 0.0) is reached
    finally:
        server.close()


def test_only_loopback_addresses_are_open_only_here():
    assert open_only_here("127.0.0.1") and open_only_here("127.0.1.1")
    assert not open_only_here("0.0.0.0") and not open_only_here("192.168.1.4")
    for text in ("localhost", "", "::1", "1.2.3.400"):
        with pytest.raises(PortError, match="IPv4 address expected") as error:
            open_only_here(text)
        assert "\n" not in str(error.value)


def test_an_address_of_another_machine_is_a_one_line_error():
    with pytest.raises(PortError, match="for the autopilot at 192.0.2.1") as error:
        HilServer(free_port(), 4, "192.0.2.1")
    assert "\n" not in str(error.value)

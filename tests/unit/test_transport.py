"""Links by URL, over real sockets and pseudo-terminals; tests wait for conditions, not times."""

import os
import socket
import time
import tty

import pytest
from set_clock import SetClock

from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2
from uam_sim_bridge.mavlink.transport.stream_transport import TcpTransport
from uam_sim_bridge.mavlink.transport.transport import UdpTransport, open_transport
from uam_sim_bridge.ports import PortError

PATIENCE = 30.0  # s, time limit of a wait


def until(condition, what):
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, f"{what}: not within {PATIENCE:g} s"
        time.sleep(0.001)
    return found


def udp(port=0):
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.bind(("127.0.0.1", port))
    s.settimeout(PATIENCE)
    return s


@pytest.fixture
def opened():
    """List of objects that are closed after the test."""
    things = []
    yield things
    for thing in things:
        thing.close()


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("", "empty"),
        ("pigeon:coop:1", "unknown kind of link"),
        ("udp", "a host and a port expected"),
        ("udp:localhost", "a host and a port expected"),
        ("udp::14550", "a host and a port expected"),
        ("udp:localhost:0", "port 0 is not in 1..65535"),
        ("udp:localhost:14550:x", "port x is not in 1..65535"),
        ("udp:localhost:1:2:3", "a host and a port expected"),
        ("tcp:localhost:65536", "port 65536 is not in 1..65535"),
        ("tcp:localhost:1:2", "a host and a port expected"),
        ("serial:/dev/ttyACM0", "a device and 9600"),
        ("serial:/dev/ttyACM0:fast", "a device and 9600"),
        ("serial::57600", "a device and 9600"),
        ("serial:/dev/ttyACM0:٩٢١٦٠٠", "a device and 9600"),
    ],
)
def test_a_bad_url_is_refused_with_what_is_allowed(url, why):
    with pytest.raises(PortError) as error:
        open_transport(url)
    text = str(error.value)
    assert why in text and "allowed: udp:HOST:PORT" in text and "\n" not in text


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("serial:/dev/no such device:57600", "does not exist"),
        ("serial:/dev/null:57600", "serial device /dev/null at 57600 baud"),
        ("udp:no.such.host.invalid:14550", "host no.such.host.invalid"),
        ("tcp:" + "x" * 70 + ":14550", "host xxx"),
    ],
)
def test_a_link_that_cannot_be_opened_is_a_one_line_error(url, why):
    with pytest.raises(PortError) as error:
        open_transport(url)
    assert why in str(error.value) and "\n" not in str(error.value)


def test_udp_by_name_both_ways(opened):
    peer, stranger = udp(), udp()
    link = open_transport(f"udp:localhost:{peer.getsockname()[1]}")
    opened += [peer, stranger, link]
    assert not link.stream and link.send(b"there")
    data, place = peer.recvfrom(100)
    assert data == b"there" and place[0] == "127.0.0.1"
    stranger.sendto(b"not me", place)
    peer.sendto(b"back", place)
    assert until(link.receive, "the answer") == [b"back"]


def test_udp_local_port_can_be_chosen(opened):
    with udp() as s:
        port = s.getsockname()[1]
    opened.append(link := open_transport(f"udp:127.0.0.1:9:{port}"))
    assert link._socket.getsockname() == ("127.0.0.1", port)
    with pytest.raises(PortError, match=f"UDP port {port} for MAVLink: .*in use"):
        open_transport(f"udp:127.0.0.1:9:{port}")


def test_udp_is_open_to_the_network_only_for_a_remote_peer(opened):
    opened += [near := UdpTransport(0, ("localhost", 9)), far := UdpTransport(0, ("192.0.2.1", 9))]
    assert near._socket.getsockname()[0] == "127.0.0.1"
    assert far._socket.getsockname()[0] == "0.0.0.0"
    far.send(b"x")  # no receiver: lost or dropped, no error


def test_udp_reads_a_flood_in_bounded_pieces(opened):
    peer = udp()
    link = open_transport(f"udp:127.0.0.1:{peer.getsockname()[1]}", 1000)
    opened += [peer, link]
    link.send(b"x")
    place = peer.recvfrom(10)[1]
    for _ in range(50):
        peer.sendto(bytes(300), place)
    first = until(link.receive, "the flood")
    assert len(first) == 4
    seen = len(first)
    while rest := link.receive():
        assert len(rest) <= 4
        seen += len(rest)
    assert seen == 50


def listener(port=0):
    s = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    s.bind(("127.0.0.1", port))
    s.listen(1)
    s.settimeout(PATIENCE)
    return s


def test_tcp_connects_again_after_a_loss_with_growing_intervals(opened):
    server, clock = listener(), SetClock()
    port = server.getsockname()[1]
    link = TcpTransport(("localhost", port), clock)
    opened.append(link)
    first, _ = server.accept()
    until(lambda: link.send(b"one"), "the connection")
    assert first.recv(3) == b"one" and link.stream and link.fileno() >= 0
    first.close()
    server.close()
    until(lambda: (link.receive(), not link.connected)[1], "the loss")
    assert link.losses == 1 and link.fileno() == -1 and not link.send(b"lost")
    tried, attempt = [], link._open
    link._open = lambda now: (tried.append(now), attempt(now))[1]
    for k in range(2560):  # 40 s; loopback refuses a connection at once
        clock.now = k / 64  # exact in binary
        link.receive()
    starts = [t for k, t in enumerate(tried) if not k or t - tried[k - 1] > 0.05]
    gaps = [b - a for a, b in zip(starts, starts[1:], strict=False)]
    assert all(a <= b + 1 / 32 for a, b in zip(gaps, gaps[1:], strict=False))
    assert 8 <= len(starts) <= 14
    assert max(gaps) == pytest.approx(5.0, abs=0.05)
    opened.append(server := listener(port))
    clock.now += 5.0

    def again():
        clock.now += 5.0
        return link.send(b"two")

    until(again, "the connection again")
    second, _ = server.accept()
    opened.append(second)
    second.settimeout(PATIENCE)
    assert second.recv(3) == b"two"
    second.sendall(b"three")
    assert b"".join(until(link.receive, "bytes")) == b"three"


def sample(k):
    return mavlink2.MAVLink_statustext_message(6, (b"%05d" % k).ljust(50, b"x"))


def test_a_full_tcp_link_drops_whole_frames(opened):
    server = listener()
    link = TcpTransport(("127.0.0.1", server.getsockname()[1]))
    opened += [server, link]
    peer, _ = server.accept()
    opened.append(peer)
    until(lambda: (link.receive(), link.connected)[1], "the connection")
    link._opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    codec, sent = Codec(1, 1), []
    for k in range(200_000):
        if link.send(codec.encode(sample(k))):
            sent.append(k)
        elif link.dropped >= 100:
            break
    assert link.dropped >= 100 and link.connected
    framer, found = Framer(codec), []
    peer.setblocking(False)

    def drained():
        try:
            found.extend(framer.stream(peer.recv(65536)))
        except BlockingIOError:
            link.receive()  # sends the rest of the partly written frame
        return len(found) == len(sent)

    until(drained, "what was sent")
    assert [int(m.text[:5]) for m in found] == sent and framer.bad_bytes == 0


@pytest.fixture
def line(opened, tmp_path):
    """A pseudo-terminal: its far end, and a link whose device can be unplugged."""
    far, near = os.openpty()
    tty.setraw(near)
    device = tmp_path / "ttyACM0"
    device.symlink_to(os.ttyname(near))
    os.close(near)
    clock = SetClock()
    link = open_transport(f"serial:{device}:921600")
    link._clock = clock
    opened.append(link)
    return far, link, device, clock


def test_serial_carries_frames_in_chunks(line):
    far, link, _, _ = line
    assert link.stream and link.bytes_per_second == 92160.0
    assert link.receive() == [] and link.connected  # an idle line is not lost
    codec = Codec(1, 1)
    frames = b"".join(codec.encode(sample(k)) for k in range(20))
    framer, found = Framer(Codec(2, 2)), []
    for i in range(0, len(frames), 7):
        os.write(far, frames[i : i + 7])
    until(
        lambda: (
            found.extend(m for c in link.receive() for m in framer.take(c, link.stream)),
            len(found) == 20,
        )[1],
        "all frames",
    )
    assert link.send(b"there") and os.read(far, 10) == b"there"
    os.close(far)


def test_serial_device_is_opened_exclusively(line):
    _, link, device, _ = line
    with pytest.raises(PortError, match="in use by another program"):
        open_transport(f"serial:{device}:921600")


def test_a_full_serial_line_drops_frames_and_does_not_block(line):
    far, link, _, _ = line
    until(lambda: (link.send(bytes(500)), link.dropped > 3)[1], "a full line")
    assert link.connected
    os.close(far)


def test_serial_is_opened_again_after_unplugging(line):
    far, link, device, clock = line
    os.close(far)
    until(lambda: (link.receive(), not link.connected)[1], "the loss")
    assert link.losses == 1 and not link.send(b"lost") and link.fileno() == -1
    device.unlink()
    clock.now += 1.0
    assert link.receive() == [] and not link.connected
    far, near = os.openpty()
    tty.setraw(near)
    device.symlink_to(os.ttyname(near))
    clock.now += 5.0
    assert link.send(b"again") and os.read(far, 10) == b"again"
    os.close(far)
    os.close(near)


def test_closed_for_good(line):
    far, link, _, clock = line
    link.close()
    clock.now += 100.0
    assert not link.send(b"x") and link.receive() == []
    os.close(far)


def test_a_serial_device_may_be_plugged_in_later(tmp_path, opened):
    device, url = tmp_path / "ttyPX4", f"serial:{tmp_path / 'ttyPX4'}:921600"
    with pytest.raises(PortError, match="does not exist"):
        open_transport(url)
    link = open_transport(url, absent=True)
    opened.append(link)
    assert not link.connected and link.receive() == [] and not link.send(b"early")
    own, far = os.openpty()
    tty.setraw(far)
    device.symlink_to(os.ttyname(far))
    until(lambda: link.send(b"late"), "the device")
    assert os.read(own, 16) == b"late"
    os.close(own)
    os.close(far)

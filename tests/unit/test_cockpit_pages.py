"""The cockpit's server, plain page and commands: what reaches a browser, and who may command."""

import math
import queue
import re
from http.client import HTTPConnection
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import uam_lab.cockpit
from uam_control.supervision import PreflightCheck, State
from uam_lab.cockpit import web
from uam_lab.cockpit.commands import BUTTONS, Commands, goal_of, question, refusal
from uam_lab.cockpit.texts import shown
from uam_lab.cockpit.vehicle_health import Health
from uam_lab.cockpit.web import HEADER, PlainPage
from uam_msgs_py.messages.status import AutopilotState, MissionStatus

BY_NAME = {button.label: button for button in BUTTONS}
HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>"


class NoServices:
    def __init__(self):
        self.called, self.published = [], []

    def ready(self, kind, name):
        return True

    def call(self, kind, name, request, answer):
        self.called.append(name)
        answer(None, "no response")

    def publish(self, topic, message):
        self.published.append((topic.name, message))


def health(state: State, time: float = 5.0, **more) -> Health:
    found = Health(3.0)
    found.autopilot = AutopilotState(True, "OFFBOARD", armed=time >= 0.0, landed=time < 0.0)
    found.set_mission(MissionStatus("phase", time, state=state.value, **more))
    return found


@pytest.mark.parametrize(
    ("state", "time", "possible"),
    [
        (State.GROUNDED, -1.0, {"Start", "Disarm", "Kill"}),
        (State.TAKING_OFF, 0.5, {"Land", "Kill"}),
        (State.FLYING, 5.0, {"Hold", "Resume", "Land", "Kill"}),
        (State.HOLDING, 5.0, {"Hold", "Resume", "Land", "Kill"}),
        (State.LANDING, 5.0, {"Kill"}),
        (State.RELEASED, 5.0, {"Resume", "Kill"}),
        (State.FAILSAFE, 5.0, {"Disarm", "Kill"}),
        (State.DISARMED, 5.0, {"Kill"}),
    ],
)
def test_buttons_offer_what_the_state_allows(state, time, possible):
    names = {"Start", "Hold", "Resume", "Land", "Disarm", "Kill"}
    seen = health(state, time)
    if state is State.FAILSAFE:
        seen.autopilot = AutopilotState(True, "AUTO.LAND", armed=True, landed=True)
    assert {name for name in names if not refusal(BY_NAME[name], seen)} == possible


def test_start_begins_the_next_flight():
    seen = health(State.DISARMED, done=True)
    assert refusal(BY_NAME["Start"], seen) == ""
    seen.preflight = [PreflightCheck("place", "9 m", "2 m", passed=False)]
    assert refusal(BY_NAME["Start"], seen) == "pre-arm report: place"


def test_start_names_the_failed_checks_and_magnet_its_state():
    seen = health(State.GROUNDED, -1.0)
    seen.preflight = [PreflightCheck("battery", "3 %", "20 %", passed=False)]
    assert refusal(BY_NAME["Start"], seen) == "pre-arm report: battery"
    assert refusal(BY_NAME["Magnet off"], seen) == "it is off"
    assert refusal(BY_NAME["Magnet on"], seen) == ""
    assert refusal(BY_NAME["Disarm"], health(State.FLYING)) == "not while flying"


def test_what_lets_something_fall_asks_first():
    flying, grounded = health(State.FLYING, magnet=True), health(State.GROUNDED, -1.0)
    assert "falls" in question(BY_NAME["Magnet off"], flying)
    assert question(BY_NAME["Magnet off"], grounded) == ""
    assert "falls" in question(BY_NAME["Magnet off"], Health(3.0))
    for name in ("Kill", "Disarm"):
        assert question(BY_NAME[name], grounded)
    assert not any(question(BY_NAME[name], flying) for name in ("Hold", "Land", "Resume"))


def test_a_typed_goal():
    goal = goal_of("0.5, -1 1.2,90").pose
    assert (goal.position.x, goal.position.y, goal.position.z) == (0.5, -1.0, 1.2)
    assert (goal.orientation.w, goal.orientation.z) == pytest.approx((math.sqrt(0.5),) * 2)
    kept = goal_of("1 2").pose
    assert (kept.position.z, kept.orientation.w, kept.orientation.z) == (0.0, 0.0, 0.0)
    for wrong in ("", "1", "a b c", "1 2 nan", "1 2 3 4 5"):
        with pytest.raises(ValueError, match="expected"):
            goal_of(wrong)


def test_all_texts_are_escaped_and_nothing_is_markdown():
    page = shown([HOSTILE, "a & b"])
    assert "<script" not in page
    assert "<img" not in page
    assert "a &amp; b" in page
    folder = Path(uam_lab.cockpit.__path__[0])
    sources = "".join(file.read_text() for file in folder.glob("*.py"))
    assert "add_markdown" not in sources
    # HTML comes from templates, which escape, and from `shown`
    assert set(re.findall(r"add_html\(([^()]*)", sources)) == {'""', '"", visible=False', "shown"}


@pytest.fixture
def served():
    todo = queue.SimpleQueue()
    plain = PlainPage(todo.put, f"/results/{HOSTILE}")
    services, said = NoServices(), []
    commands = Commands(services, health(State.FLYING), lambda done, text: said.append(text))
    server = web.serve("127.0.0.1", 0, "uam", plain, ["http://lab:9000"])
    plain.show("<b>FLYING</b>", [HOSTILE], False, commands)
    yield server, todo, services, said
    server.stop()


def get(server, path: str, host: str | None = None, **headers) -> tuple[int, str, dict]:
    connection = HTTPConnection("127.0.0.1", server.get_port(), timeout=20.0)
    host = host or f"localhost:{server.get_port()}"
    connection.request("GET", path, headers={"Host": host, **headers})
    answer = connection.getresponse()
    return answer.status, answer.read().decode(), dict(answer.getheaders())


def test_pages_are_guarded_and_strangers_are_refused(served):
    server, todo, services, said = served
    for path in ("/", "/control"):
        status, page, headers = get(server, path, **{"Accept-Encoding": "gzip"})
        policy = headers["Content-Security-Policy"]
        (nonce,) = re.findall(r"'nonce-([^']+)'", policy)
        assert status == 200
        assert headers["X-Frame-Options"] == "DENY"
        assert "frame-ancestors 'none'" in policy
        assert "script-src 'unsafe-inline'" not in policy
        assert "@NONCE@" not in page
        # every script of the page has the nonce of this answer; none comes from the texts
        scripts = re.findall(r"<script\b[^>]{0,60}", page)
        assert scripts
        assert all(f'nonce="{nonce}"' in script for script in scripts)
        assert get(server, path, host="evil.example")[0] == 403
        assert nonce not in get(server, path)[2]["Content-Security-Policy"]
    assert get(server, "/nothing")[0] == 404
    assert get(server, "/state", host="lab:9000")[0] == 200
    port = server.get_port()
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws://127.0.0.1:{port}", origin="http://evil", subprotocols=["viser-v0"])


def test_a_narrow_window_gets_the_plain_page_which_links_the_scene(served):
    server, *_ = served
    scene, plain = (get(server, path)[1] for path in ("/", "/control"))
    assert re.search(r"screen.width\) < 700", scene)
    assert 'location.replace("/control?without=width")' in scene
    (anyway,) = re.findall(r'<a href="/([^"]+)">The page with the scene', plain)
    assert f'location.search !== "{anyway}"' in scene  # the link is not turned back


def test_only_the_page_commands(served):
    server, todo, services, said = served
    _, page, _ = get(server, "/control")
    (secret,) = re.findall(rf'"{HEADER}": "([^"]+)"', page)
    assert get(server, "/command?is=Kill")[0] == 403
    assert get(server, "/command?is=Kill", **{HEADER: "x"})[0] == 403
    assert get(server, "/command?is=Kill", **{HEADER: "\xe9"})[0] == 403
    assert get(server, "/command?is=Fly", **{HEADER: secret})[0] == 404
    assert get(server, "//[", **{HEADER: secret})[0] == 404
    assert get(server, "/command?is=Land&is=Fly", **{HEADER: secret})[0] == 404
    assert todo.empty()
    assert get(server, "/command?is=Land", **{HEADER: secret})[0] == 200
    todo.get()()
    assert services.called == ["mission/land"]
    assert said == ["Land: mission: no response"]
    assert get(server, "/goto?is=1%202%203", **{HEADER: secret})[0] == 200
    todo.get()()
    assert services.published[0][1].pose.position.y == 2.0

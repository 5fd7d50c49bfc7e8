"""The cockpit in a real browser, beside a flight."""

import shutil
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.node_environment import transport_environment
from uam_msgs_py.node.node_parameters import plain

# extra `browser`; make slow installs it
from_playwright = pytest.importorskip("playwright.sync_api")
expect = from_playwright.expect


PATIENCE = 180_000  # [ms] only a failing test waits that long
expect.set_options(timeout=PATIENCE)
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)
# rendered by the processor; nothing is looked for outside of this machine
SWITCHES = (
    "--no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--disable-background-networking --disable-component-update --disable-sync"
).split()
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason=f"needs a browser: {' or '.join(BROWSERS)}"),
]


def to_and_fro(seconds: int) -> str:
    """A scenario of this length: a browser may take its time."""
    moves = [
        f"  - {{coordinate: x, from: {t}, until: {t + 4}, to: {0.8 * (t % 8 < 4)}}}"
        for t in range(4, seconds, 4)
    ]
    return "\n".join(
        [
            "description: To and fro, for the test of the cockpit.",
            "phases:",
            "  - {from: 0, name: take-off}",
            "  - {from: 4, name: to and fro}",
            f"  - {{from: {seconds + 4}, name: land}}",
            "moves:",
            "  - {coordinate: z, from: 0, until: 3, to: 1.0}",
            *moves,
            f"landing: {{at: {seconds + 4}, duration: 4}}",
        ]
    )


@pytest.fixture
def flight(fly, tmp_path):
    """A flight under way, with a cockpit."""
    (tmp_path / "long.yaml").write_text(to_and_fro(800))
    flight = fly("--view", "--scenario", str(tmp_path / "long.yaml"))
    flight.until(lambda: "ROS domain" in flight.said, "started")
    flight.address = flight.said.split("cockpit: ")[1].split()[0]
    flight.domain = int(flight.said.split("ROS domain ")[1].split(",")[0])
    flight.until_phase("take-off")
    return flight


@pytest.fixture
def page(flight):
    """The page in a browser."""
    with from_playwright.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=SWITCHES)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(PATIENCE)
        page.goto(flight.address)
        yield page
        browser.close()


def value_in(flight, node: str, name: str):
    """A parameter as the running node tells it."""
    with Guest("asker", transport_environment(), flight.domain) as guest:
        executor = SingleThreadedExecutor(context=guest.context)
        executor.add_node(guest.node)
        client = guest.node.create_client(GetParameters, f"/{node}/get_parameters")
        assert client.wait_for_service(30.0)
        future = client.call_async(GetParameters.Request(names=[name]))
        executor.spin_until_future_complete(future, 30.0)
        return plain(future.result().values[0])


def scene(page) -> np.ndarray:
    """The picture of the 3-D scene, between the panels."""
    clip = {"x": 340, "y": 150, "width": 690, "height": 740}
    return np.asarray(Image.open(BytesIO(page.screenshot(clip=clip))).convert("RGB"), dtype=int)


def field(page, label: str):
    """The text field below a label, which may be broken between its parts."""
    return page.locator(f"xpath=//label[normalize-space(.)='{label}']/following::input[1]")


def test_a_browser_sees_and_steers_a_flight_and_strangers_do_not(flight, page):
    def until(condition, what: str) -> None:
        for _ in range(PATIENCE // 250):
            if condition():
                return
            page.wait_for_timeout(250)
        pytest.fail(f"{what}: not in time\n{page.inner_text('body')}")

    expect(page.locator("#uam-state")).to_contain_text("TO AND FRO", timeout=PATIENCE)
    expect(page.locator("#uam-errors")).to_contain_text("cm")
    expect(page.get_by_text("OFFBOARD, armed")).to_be_visible()
    expect(page.get_by_text("companion")).to_be_visible()
    expect(page.get_by_text("ms there and back")).to_be_visible()
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    page.get_by_role("button", name="Kill").click()
    expect(page.get_by_text("a vehicle in the air falls. Kill?")).to_be_visible()
    expect(page.get_by_role("button", name="Cancel")).to_be_focused()
    page.keyboard.press("Enter")  # must not kill
    page.get_by_role("button", name="Magnet off").click(force=True)
    expect(page.get_by_text("Magnet off?")).to_have_count(0)  # it is off

    first = scene(page)
    page.wait_for_timeout(500)
    until(lambda: np.sum(np.abs(scene(page) - first).sum(axis=2) > 60) > 200, "the scene moves")

    page.get_by_role("tab", name="Position", exact=True).click()
    before = value_in(flight, "position_controller", "lambda_1")
    slider = page.get_by_role("slider").first
    slider.focus()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    until(  # its last step, too: the answer writes the field that is filled next
        lambda: (
            value_in(flight, "position_controller", "lambda_1")[0]
            == pytest.approx(float(slider.get_attribute("aria-valuenow")))
        ),
        "the slider counts",
    )
    assert value_in(flight, "position_controller", "lambda_1")[0] > before[0]
    assert value_in(flight, "position_controller", "lambda_1")[1:] == before[1:]

    after = value_in(flight, "position_controller", "lambda_1")
    field(page, "lambda_1").fill("-1, 1, 1")
    field(page, "lambda_1").press("Enter")
    expect(page.get_by_text("refused:").first).to_contain_text("lambda_1")
    assert value_in(flight, "position_controller", "lambda_1") == after

    state = page.locator("#uam-state")
    page.get_by_role("button", name="Hold").click()
    expect(state).to_contain_text("HOLDING", timeout=PATIENCE)
    page.get_by_role("button", name="Resume").click()
    expect(state).not_to_contain_text("HOLDING", timeout=PATIENCE)

    field(page, "Go to").fill("0.5 0 1.2")
    page.get_by_role("button", name="Go", exact=True).click()
    expect(page.get_by_text("goal_pose: accepted")).to_be_visible()

    page.get_by_text("Hand", exact=True).click()
    page.get_by_role("button", name="Marker at the hand").click()
    expect(page.get_by_text("within reach")).to_be_visible()
    page.get_by_role("button", name="Go with the hand").click()
    expect(page.get_by_text("end_effector/goal_pose: accepted")).to_be_visible()

    page.get_by_role("button", name="Freeze adaptation").click()
    until(lambda: value_in(flight, "arm_controller", "adapt") is False, "adaptation is frozen")
    expect(page.get_by_text("frozen: arm_controller, attitude_controller")).to_be_visible()

    page.goto(f"{flight.address}/control")
    plain = page.locator("#uam-plain")
    expect(plain).to_contain_text("OFFBOARD, armed")
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    page.get_by_role("button", name="Kill").click()
    expect(page.get_by_text("a vehicle in the air falls. Kill?")).to_be_visible()
    page.keyboard.press("Enter")
    expect(page.get_by_text("a vehicle in the air falls. Kill?")).to_be_hidden()
    page.get_by_role("button", name="Hold").click()
    expect(plain).to_contain_text("HOLDING")

    url = flight.address.replace("http", "ws")
    with connect(url, origin=flight.address, subprotocols=["viser-v0"]):
        pass
    with pytest.raises(InvalidStatus, match="403"):
        connect(url, origin="http://elsewhere.example", subprotocols=["viser-v0"])

    page.get_by_role("button", name="Land").click()
    expect(page.get_by_role("heading", name="The flight is over")).to_be_in_viewport()
    for text in ("FLIGHT OVER", "report.html"):
        expect(page.get_by_role("alert")).to_contain_text(text)


def test_a_browser_without_webgl_has_the_commands(flight):
    with from_playwright.sync_playwright() as playwright:
        without = ["--no-sandbox", "--disable-gpu", "--disable-webgl", "--disable-3d-apis"]
        browser = playwright.chromium.launch(executable_path=BROWSER, args=without)
        page = browser.new_page()
        page.set_default_timeout(PATIENCE)
        page.goto(flight.address)
        page.get_by_role("button", name="Hold").click()
        expect(page.locator("#uam-plain")).to_contain_text("HOLDING", timeout=PATIENCE)
        expect(page.get_by_text("no WebGL")).to_be_visible()
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        browser.close()


def test_a_phone_has_the_commands(flight, page):
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(flight.address)
    expect(page.get_by_text("This window is narrow")).to_be_visible()
    expect(page.get_by_role("button", name="Land")).to_be_enabled()

"""ROS parameter files: by hand, dumped, joined, one over the other."""

import pytest

from uam_control.profiles.profile import ProfileError, load_profile
from uam_control.settings import configuration

DUMP = """\
/arm_controller:
  ros__parameters:
    control_period: 0.004
    epsilon: 1e-4
    varpi: 0.9
    qos_overrides:
      /parameter_events:
        publisher:
          depth: 1000
    start_type_description_service: true
    use_sim_time: false
/mission:
  ros__parameters:
    control_period: 0.004
    scenario: hover
    takeoff_delay: 1.0
/mavlink_bridge:
  ros__parameters:
    local_port: 14540
    signing_key: set
    autopilot: udp:127.0.0.1:14580
    thr_mdl_fac: 0.3
"""


def test_a_dump_over_a_profile_changes_what_it_names(tmp_path):
    file = tmp_path / "dump.yaml"
    file.write_text(DUMP)
    base, found = load_profile("s500"), load_profile("s500", str(file))
    assert found.name == "s500+dump"
    arm = found.sets["arm_controller"]
    assert (arm.varpi, arm.epsilon) == (0.9, 1e-4)
    assert arm.lambda_1 == base.sets["arm_controller"].lambda_1
    assert found.sets["position_controller"] == base.sets["position_controller"]
    assert found.sets["mission"].takeoff_delay == 1.0
    assert found.bridge() == {"thr_mdl_fac": 0.3}, "links are those of the flight"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("/*/mission: {ros__parameters: {adapt: true}}", "name each node instead, or all of them"),
        ("/**: {ros__parameters: {tilt_hld: 1.0}}", "'/\\*\\*': tilt_hld is no parameter of"),
        ("/**: {ros__parameters: {law: mine}}", "position_controller: "),
        ("/mission: {ros__parameters: {}}\nmission: {ros__parameters: {}}", "two sections"),
        ("/uav2/mission: {ros__parameters: {tilt_hold: 0.7}}", "/uav2, not /: name the section 'm"),
        ("uav2: {mission: {ros__parameters: {tilt_hold: 0.7}}}", "/uav2, not /: name the section"),
        ("uav2: {mission: {tilt_hold: 0.7}}", "'uav2/mission' has no 'ros__parameters' mapping"),
        ("mission: {ros__parameters: {takeoff_delay: '1'}}", "'1' is not numeric"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, text, complaint):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    s500 = str(configuration.path("profiles/s500.yaml"))
    with pytest.raises(ProfileError, match=complaint):
        load_profile(s500, str(file))


BARE, FULL = "mission: {ros__parameters: {%s}}", "/uav1/mission: {ros__parameters: {%s}}"
EVERY = "/**: {ros__parameters: {%s}}"


@pytest.mark.parametrize(
    ("namespace", "sections", "tilt_hold"),
    [
        ("/", {BARE: 0.6}, 0.6),
        ("/uav1", {BARE: 0.6}, 0.6),
        ("/uav1", {FULL: 0.7}, 0.7),
        ("/uav1", {"uav1: {mission: {ros__parameters: {%s}}}": 0.7}, 0.7),
        ("/uav1", {FULL: 0.7, BARE: 0.6}, 0.7),
        ("/uav1", {EVERY: 0.5}, 0.5),
        ("/", {BARE: 0.6, EVERY: 0.5}, 0.6),
        ("/uav1", {FULL: 0.7, EVERY: 0.5}, 0.7),
    ],
)
def test_sections_are_those_of_the_flights_namespace(tmp_path, namespace, sections, tilt_hold):
    """As for nodes by hand with --params-file, see docs/interfaces.md."""
    file = tmp_path / "mine.yaml"
    file.write_text("\n".join(text % f"tilt_hold: {value}" for text, value in sections.items()))
    found = load_profile("s500", str(file), namespace=namespace)
    base = load_profile("s500")
    assert found.sets["mission"].tilt_hold == tilt_hold != base.sets["mission"].tilt_hold
    assert found.sets["arm_controller"] == base.sets["arm_controller"]


def test_a_section_of_every_node_gives_each_node_what_it_has(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("/**: {ros__parameters: {use_sim_time: true, varpi: 0.3, thrust_max: 30.0}}")
    found, base = load_profile("s500", str(file)), load_profile("s500")
    assert {found.sets[f"{one}_controller"].varpi for one in ("position", "arm")} == {0.3}
    assert found.sets["position_controller"].thrust_max == 30.0
    assert found.sets["state_estimator"] == base.sets["state_estimator"]


@pytest.mark.parametrize("text", ["mission: {ros__parameters: {tilt_hold: 0.7}}", "{}"])
def test_a_partial_file_alone_is_refused_with_what_it_needs(tmp_path, text):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    complaint = "position_controller: inertia is missing: 3 numbers, each .*; a file with a part of"
    with pytest.raises(ProfileError, match=complaint) as refused:
        load_profile(str(file))
    assert str(refused.value).endswith("as --profile s500 --profile mine.yaml")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("misson: {ros__parameters: {tilt_hold: 0.7}}", "section misson: .* did you mean mission"),
        ("mission: {ros__parameters: {tilt_hld: 0.7}}", "tilt_hld: .* did you mean tilt_hold"),
        ("mission: {ros__parameters: {}, tilt_hold: 0.7}", "tilt_hold: not within 'ros__param"),
    ],
)
def test_what_no_node_would_read_is_refused(tmp_path, text, complaint):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ProfileError, match=f"mine.yaml: .*{complaint}"):
        load_profile("s500", str(file))
    file.write_text("my_mission: {ros__parameters: {tilt_hld: 0.7}}")  # a node of the user's own
    assert load_profile("s500", str(file)).sets == load_profile("s500").sets

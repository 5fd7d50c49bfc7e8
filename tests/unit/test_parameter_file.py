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
        ("/**: {ros__parameters: {adapt: true}}", "'/\\*\\*': name each node instead"),
        ("a/mission: {ros__parameters: {}}\nmission: {ros__parameters: {}}", "two sections"),
        ("mission: {ros__parameters: {takeoff_delay: '1'}}", "'1' is not numeric"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, text, complaint):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    s500 = str(configuration.path("profiles/s500.yaml"))
    with pytest.raises(ProfileError, match=complaint):
        load_profile(s500, str(file))

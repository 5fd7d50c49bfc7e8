"""The bridge's section of a profile, where no node declares its parameters."""

import pytest

from uam_control.profiles.profile import ProfileError, load_profile
from uam_sim_bridge.nodes.bridge_parameters import check_names


def with_bridge(folder, line):
    file = folder / "mine.yaml"
    file.write_text(f"mavlink_bridge: {{ros__parameters: {{{line}}}}}")
    return load_profile("s500", str(file))


@pytest.mark.parametrize(
    "line", ["thr_mdl_fac: 0.3", "gcs: 'udp:127.0.0.1:14550'", "wait_for_device: true"]
)
def test_parameters_of_the_node_pass(tmp_path, line):
    check_names(with_bridge(tmp_path, line))


def test_another_name_is_refused_with_its_place_and_the_nearest_one(tmp_path):
    expected = "mine.yaml: mavlink_bridge: thr_mdl_fca: unknown, did you mean thr_mdl_fac?"
    with pytest.raises(ProfileError, match=expected):
        check_names(with_bridge(tmp_path, "thr_mdl_fca: 0.3"))

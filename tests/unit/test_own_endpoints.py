"""The property by which Fast DDS leaves publishers and subscriptions of one process apart."""

import os
from pathlib import Path
from xml.etree import ElementTree

import pytest

from uam_control.settings import configuration
from uam_msgs_py.node import own_endpoints
from uam_msgs_py.node.own_endpoints import PROFILES_FILE, ignore_own_endpoints, with_property


def flat(text):
    """Tags and texts of a document, without its comments and spaces."""
    return [
        (e.tag.split("}")[1], (e.text or "").strip()) for e in ElementTree.fromstring(text).iter()
    ]


def test_the_profiles_of_a_flight_get_the_property_and_keep_the_rest():
    before = configuration.path("dds/fastdds.xml").read_text()
    after = flat(with_property(before))
    added = [
        ("propertiesPolicy", ""),
        ("properties", ""),
        ("property", ""),
        ("name", own_endpoints.PROPERTY),
        ("value", "true"),
    ]
    start = after.index(added[0])
    assert after[start : start + len(added)] == added
    assert after[:start] + after[start + len(added) :] == flat(before)


def test_properties_of_the_user_stay():
    text = own_endpoints.EMPTY.replace(
        "<rtps/>",
        "<rtps><propertiesPolicy><properties><property><name>a</name><value>b</value></property>"
        "</properties></propertiesPolicy></rtps>",
    )
    names = [text for tag, text in flat(with_property(text)) if tag == "name"]
    assert names == ["a", own_endpoints.PROPERTY]


@pytest.mark.parametrize("given", [None, "dds/fastdds.xml"])
def test_the_environment_is_changed_only_meanwhile(monkeypatch, given):
    monkeypatch.delenv(PROFILES_FILE, raising=False)
    before = None if given is None else str(configuration.path(given))
    if before is not None:
        monkeypatch.setenv(PROFILES_FILE, before)
    with ignore_own_endpoints():
        assert own_endpoints.PROPERTY in Path(os.environ[PROFILES_FILE]).read_text()
    assert os.environ.get(PROFILES_FILE) == before


def test_a_file_that_is_no_xml_is_left_to_the_middleware(monkeypatch, tmp_path):
    file = tmp_path / "mine.xml"
    file.write_text("no profiles")
    monkeypatch.setenv(PROFILES_FILE, str(file))
    with ignore_own_endpoints():
        assert os.environ[PROFILES_FILE] == str(file)

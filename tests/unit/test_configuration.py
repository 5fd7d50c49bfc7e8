"""Finding configuration files."""

import pytest

from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError


def test_a_shipped_file_is_found():
    assert configuration.path("profiles/s500.yaml").is_file()
    assert configuration.named("profiles", "s500") == configuration.path("profiles/s500.yaml")


def test_unknown_names_list_what_there_is():
    with pytest.raises(ConfigurationError, match=r"no profiles/s5000.yaml .*s500.yaml"):
        configuration.path("profiles/s5000.yaml")
    with pytest.raises(ConfigurationError, match="config/ has: .*profiles"):
        configuration.path("no_such_folder/s500.yaml")
    with pytest.raises(ConfigurationError, match="unknown profile 's5000'; there are: .*s500"):
        configuration.named("profiles", "s5000")


def test_a_file_of_the_users_own(tmp_path):
    mine = tmp_path / "mine.yaml"
    with pytest.raises(ConfigurationError, match="mine.yaml does not exist"):
        configuration.named("profiles", str(mine))
    mine.write_text("a: 1")
    assert configuration.named("profiles", str(mine)) == mine


def test_an_installed_copy_is_found_under_the_prefix(tmp_path, monkeypatch):
    package = tmp_path / "lib/python3.12/site-packages/uam_control"
    (tmp_path / "share/uam/config").mkdir(parents=True)
    package.mkdir(parents=True)
    monkeypatch.setattr(configuration, "__file__", str(package / "configuration.py"))
    configuration.root.cache_clear()
    try:
        assert configuration.root() == tmp_path / "share/uam/config"
        (tmp_path / "share/uam/config").rmdir()
        configuration.root.cache_clear()
        with pytest.raises(ConfigurationError, match="install the project again"):
            configuration.root()
    finally:
        configuration.root.cache_clear()

"""What a command refuses is one line; a mistake of the program is raised."""

from argparse import Namespace

import pytest

from uam_control.settings.configuration import ConfigurationError
from uam_lab.cli.main import main
from uam_lab.cli.parser import run


def test_an_error_of_the_project_or_the_system_is_one_line(capsys):
    for error, text in (
        (ConfigurationError("a.yaml:\nx is 7"), "a.yaml:␊x is 7"),
        (FileNotFoundError(2, "No such file", "b.csv"), "[Errno 2] No such file: 'b.csv'"),
    ):

        def refuse(_, error=error):
            raise error

        assert run(Namespace(command="fly", run=refuse)) == 2
        assert capsys.readouterr().err == f"uam fly: {text}\n"


def test_a_mistake_of_the_program_is_raised():
    with pytest.raises(ZeroDivisionError):
        run(Namespace(command="fly", run=lambda _: 1 / 0))


def test_an_empty_name_is_not_the_present_folder(capsys):
    for command in (["fly", "--out", ""], ["report", " "]):
        with pytest.raises(SystemExit):
            main(command)
        assert "the name is empty" in capsys.readouterr().err

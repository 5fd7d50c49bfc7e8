"""`uam --version` names the package's version, and the commit of a checkout."""

import re
from importlib.metadata import version

import pytest

from uam_lab.cli.main import main


def test_the_version_is_printed_in_one_line(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    (line,) = capsys.readouterr().out.splitlines()
    assert end.value.code in (0, None)
    assert re.fullmatch(rf"uam {re.escape(version('uam'))}(, commit .+)?", line), line

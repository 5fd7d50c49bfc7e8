"""The end of the recorder on a full disk."""

import errno
import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from uam_lab.records.recorder import _complete

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class Recording:
    lost, lost_by_publisher = {}, {}
    ended = "the log cannot be written: No space left on device"
    log = SimpleNamespace(counts={"/clock": 3}, ended=ended)

    def close(self):
        raise FULL


def test_the_statistics_are_written_without_the_metadata(tmp_path):
    said, file = [], tmp_path / "recorder.json"
    log = SimpleNamespace(error=said.append, warning=said.append)
    node = SimpleNamespace(get_logger=lambda: log)
    _complete(node, Recording(), str(file))
    assert json.loads(file.read_text())["ended"] == Recording.ended
    _complete(node, Recording(), "/dev/full")
    assert Path("/dev/full").is_char_device()
    metadata = "metadata.yaml cannot be written: No space left on device"
    assert said == [metadata, metadata, "/dev/full cannot be written: No space left on device"]

"""A log that ends at its size limit or after a write error, and reports the reason."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from uam_lab.records.recording.bag import schema
from uam_lab.records.recording.bounded_log import MEGABYTE, BoundedLog

NAME = "std_msgs/msg/String"


def fill(log, count, size=1000):
    channel = log.add_channel("/text", NAME, schema(NAME), {})
    for k in range(count):
        log.write(channel, k, k, bytes(str(k) * size, "ascii"), k)
        if k % 10 == 9:
            log.flush()


def test_it_ends_at_its_size_and_is_complete(tmp_path):
    file = tmp_path / "log.mcap"
    log = BoundedLog(file, limit=1e-3)
    fill(log, 1000)
    log.close()
    assert log.ended == "the log reached its size limit, 0.001 MB"
    assert file.stat().st_size < 0.01 * MEGABYTE
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert 0 < summary.statistics.message_count == log.counts["/text"] < 1000


def test_without_a_limit_it_does_not_end(tmp_path):
    log = BoundedLog(tmp_path / "log.mcap", limit=0.0)
    fill(log, 1000)
    log.close()
    assert log.ended == "" and log.counts["/text"] == 1000


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_ends_it_and_nothing_is_raised():
    log = BoundedLog(Path("/dev/full"), limit=0.0)
    fill(log, 100)
    log.add_metadata("more", {"than": "fits"})
    log.close()
    assert log.ended == "the log cannot be written: No space left on device"

"""Columns of the recording of the default vehicle."""

from uam_control.vehicle import load_description
from uam_lab.records.results.timeseries import columns_of

COLUMNS = columns_of(load_description())

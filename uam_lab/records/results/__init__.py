"""The result folder: time series, metrics and outcome of a flight."""

"""Flying: the engines, the recorded time series, its figures of merit and the result folder."""

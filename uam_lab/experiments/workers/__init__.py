"""Processes of this machine or of a cluster, to which independent pieces of work are handed."""

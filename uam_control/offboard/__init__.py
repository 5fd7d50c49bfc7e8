"""Offboard control seen from the companion computer: modes, arming, the sequence of requests."""

"""Nodes that only watch a flight: recorder, scene and cockpit."""

"""Nodes without influence on the flight: recorder, scene and cockpit."""

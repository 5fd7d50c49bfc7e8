"""The direct engine: the objects of the nodes in one loop."""

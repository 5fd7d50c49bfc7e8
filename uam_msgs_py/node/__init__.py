"""The base of every node: executor, joins, parameters, connections."""

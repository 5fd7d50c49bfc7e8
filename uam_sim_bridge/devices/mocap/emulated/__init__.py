"""A motion capture server that speaks NatNet."""

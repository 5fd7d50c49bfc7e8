"""`uam compare`: the paper's comparison, every controller over the same flights."""

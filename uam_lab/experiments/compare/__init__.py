"""`uam compare`: the paper's comparison, all controllers over the same flights."""

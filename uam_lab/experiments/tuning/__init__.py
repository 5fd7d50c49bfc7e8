"""`uam tune`: searches a controller's parameters over whole flights of the direct engine."""

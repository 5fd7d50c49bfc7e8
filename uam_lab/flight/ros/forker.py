"""What the process that forks a flight's nodes does first; importing this does it.

Compiled functions are loaded and run once, which each node would otherwise do for itself.
"""

import gc

from uam_control.laws import catalogue
from uam_lab.flight.direct.warm_up import warm_up

warm_up([catalogue.DEFAULT])
gc.collect()
gc.freeze()  # a collection in a child must not copy what it shares with the others

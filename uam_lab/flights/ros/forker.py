"""Preparation of the process that forks a flight's nodes; importing this module runs it.

It imports the nodes, loads the compiled functions and runs them once, and prepares the log, so that
no node has to repeat this.
"""

import gc
import importlib

from uam_control.laws import catalogue
from uam_lab.flights.direct import warm_up
from uam_lab.flights.ros import node_arguments
from uam_msgs_py.node import log_callers
from uam_msgs_py.node.wiring import COCKPIT
from uam_sim_bridge.plant import Vehicle

hosts = (module for module, _ in node_arguments.HOSTS.values())
for module in (*node_arguments.MODULES.values(), *hosts):
    if module != node_arguments.MODULES[COCKPIT]:  # few flights have it, and its import is long
        importlib.import_module(module)
warm_up.fly(catalogue.DEFAULT, Vehicle.load())  # what only few flights need, they load themselves
log_callers.find_modules()
gc.collect()
gc.freeze()  # a garbage collection in a child must not copy the shared memory pages

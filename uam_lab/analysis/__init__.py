"""Check of the paper's stability proof (Appendix) with the simulator's truth, after a flight.

`stability.analyse` is the entry point; docs/law.md lists the equation of each quantity.
"""

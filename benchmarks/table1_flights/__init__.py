"""Flights of Table I as its authors probably flew it: assumptions, flights and tables."""

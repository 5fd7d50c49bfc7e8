"""Texts and tables of a report."""

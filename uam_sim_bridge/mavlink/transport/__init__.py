"""Bytes over UDP, TCP and serial lines."""

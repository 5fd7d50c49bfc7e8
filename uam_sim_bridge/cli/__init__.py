"""The `uam` command."""

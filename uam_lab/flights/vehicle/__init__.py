"""A vehicle in a laboratory: its file, its devices, and its bring-up without a simulator."""

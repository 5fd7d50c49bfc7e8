"""A laboratory without hardware: one plant behind emulated devices, paced by the wall clock."""

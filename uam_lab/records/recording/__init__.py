"""log.mcap: write it, and read a flight from it."""

"""log.mcap: writing it, and reading a flight back from it."""

"""What a flight leaves: log, table, facts, metrics."""

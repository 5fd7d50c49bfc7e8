"""What a person runs: command line, flights, recordings, results, reports, campaigns."""

"""What benchmarks/rate_steps.py is made of."""

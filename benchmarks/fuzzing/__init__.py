"""What benchmarks/fuzz_mavlink.py is made of."""

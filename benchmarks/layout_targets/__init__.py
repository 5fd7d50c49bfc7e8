"""Parts of benchmarks/layouts.py."""

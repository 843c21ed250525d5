"""Benchmarks: each is one command that measures figures of README.md and docs."""

"""Benchmarks: each is one command that measures figures of README.md and docs."""

import keras_pendulum  # noqa: F401  # before NumPy, which reads its variables

"""Limits that several modules share."""

LARGEST_FILE = 2**30  # bytes of a `.h5` file; a checkpoint of `reference` has 4.5 MB
LARGEST_WEIGHT = 1e6  # of a network; those of one that learned well are below 100
LARGEST_DESCRIPTION = 2**20  # bytes of JSON: a file's names, attributes, types and shapes

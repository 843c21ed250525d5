"""Figures that the README states, each from one command."""

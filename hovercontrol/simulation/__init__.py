"""Blocks of any kind in time, in Python: integrated between ticks, stepped by a runner."""

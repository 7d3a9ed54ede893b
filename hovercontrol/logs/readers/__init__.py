"""Readers of log files, one file for each format; :mod:`hovercontrol.logs.source` lists and chooses them."""

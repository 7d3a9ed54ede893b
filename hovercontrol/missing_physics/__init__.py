"""A benchmark of missing physics: logs of machines whose models lack something, and the scoring of tools."""

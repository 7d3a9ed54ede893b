"""Import of FMUs from any source: checked, run, and used as python-control systems."""

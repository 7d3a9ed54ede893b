"""Anyone's FMU: read, checked, run, and a python-control system."""

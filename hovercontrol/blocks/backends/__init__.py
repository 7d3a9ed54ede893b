"""A Block's backends: python-control systems, C, machine code, sweeps over many runs."""

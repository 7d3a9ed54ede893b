"""The faces of a Block: NumPy functions, python-control systems."""

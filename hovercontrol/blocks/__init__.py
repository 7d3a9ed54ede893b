"""The Block: one symbolic definition of a system, its wiring, simulation and backends.

May import ``base``. Begin with ``block.py`` and ``interconnect.py``. ``simulation/`` runs a Block in time;
``backends/`` makes NumPy and C functions, python-control systems, JAX and CasADi of it.
``block_backends.py`` is the one file of the package that imports upwards: the export of FMUs.
"""

"""What measured logs say of a model: check, identify, diagnose, monitor, fleet, benchmark.

May import all rooms below: ``fmi``, ``control``, ``craft``, ``logs``, ``blocks``, ``base``. ``engine/``
fits a model to logs by maximum likelihood (begin with ``problem.py``, then ``fit.py``); ``identify/`` makes
a table of coefficients of it, ``diagnose/`` searches for missing effects (``diagnose.py``, ``search/``),
``monitor/`` detects changes at run time, ``fleet/`` compares the logs of many craft, ``check/`` examines
logs beforehand, ``benchmark/`` scores tools on hidden effects.
"""

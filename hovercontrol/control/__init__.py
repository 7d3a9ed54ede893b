"""Controllers, observers, guidance, analysis of loops, K06's autopilot.

May import ``craft``, ``logs``, ``blocks`` and ``base``. Each controller, reference and observer is a
function that returns a Block; begin with ``controllers/tracking.py`` and ``observers/kalman_bucy.py``.
``analysis/`` has margins, regions and stability tests; ``autopilot/`` puts sensors, links and actuators
around a law.
"""

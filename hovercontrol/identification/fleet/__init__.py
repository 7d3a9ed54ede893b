"""Many craft, many logs, one model: what differs between craft, what drifts, what all of them lack.

Begin with ``fleet.py``: it runs ``worker.py`` on every log, in processes or on a cluster (``run.py``), and
keeps each result (``store.py``). ``findings.py`` draws the conclusions: coefficients of all craft and each
craft's own (``random_effects.py``), changes over time (``trends.py``), effects that one or all craft lack.
``display.py`` makes the page.
"""

from hovercontrol.identification.fleet.fleet import Fleet, fleet

__all__ = ["fleet", "Fleet"]

"""C17 Theorem 4: with which rudder arm and control point the craft goes nose-first, stern-first or spins."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.zero_dynamics import main

if __name__ == "__main__":
    script(main, __doc__ or "")

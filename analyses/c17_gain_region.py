"""C17 Theorem 3: gains that bring the craft to the ellipse in time, promised, exact and simulated."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.gain_region import main

if __name__ == "__main__":
    script(main, __doc__ or "")

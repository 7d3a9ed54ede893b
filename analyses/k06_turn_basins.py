"""K06's turn law (2.39): from where the craft turns and when, where it is stuck, where it ends drifting."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.turn_basins_figure import main

if __name__ == "__main__":
    script(main, __doc__ or "")

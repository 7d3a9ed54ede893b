"""C17 section VIII-A: which reference shows which coefficient, when c3 and c4 are slow, the best ellipse."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.excitation import main

if __name__ == "__main__":
    script(main, __doc__ or "")

"""C17 Theorem 5: how far craft, controller and estimator may begin from the ellipse and from the truth."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.interconnection import main

if __name__ == "__main__":
    script(main, __doc__ or "")

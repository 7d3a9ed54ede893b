"""C17 Theorem 5 and (27): what wrong coefficients cost, by the input-to-state gain and simulated."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.iss_gain import main

if __name__ == "__main__":
    script(main, __doc__ or "")

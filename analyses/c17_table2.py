"""C17 Table II: how its three errors depend on P0, R, noise and drag, of which the paper prints only R."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.table2 import main

if __name__ == "__main__":
    script(main, __doc__ or "")

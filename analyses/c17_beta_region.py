"""C17 (18)-(19): which beta the Lyapunov function admits, and what decay it guarantees."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.c17.beta_region import main

if __name__ == "__main__":
    script(main, __doc__ or "")

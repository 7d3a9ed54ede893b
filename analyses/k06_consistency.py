"""Whether the navigation filters' errors are as large as their covariances say: NEES and NIS."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.consistency import main

if __name__ == "__main__":
    script(main, __doc__ or "")

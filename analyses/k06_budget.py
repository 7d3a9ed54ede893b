"""What each imperfection of K06's real loop costs in each trial, and whether INS noise dominates."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.budget import main

if __name__ == "__main__":
    script(main, __doc__ or "")

"""What delay, jitter and loss K06's forward law bears, and C17's tracking loop along its ellipse."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.margins import main

if __name__ == "__main__":
    script(main, __doc__ or "")

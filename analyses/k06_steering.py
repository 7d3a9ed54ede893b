"""Steering under way: the real loop's mean motion over the stick, and where C17's law holds a turn."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.steering import main

if __name__ == "__main__":
    script(main, __doc__ or "")

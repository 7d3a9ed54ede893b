"""K06 chapter 7: the position by raw ranges, a particle filter against the extended Kalman filter."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.particles import main

if __name__ == "__main__":
    script(main, __doc__ or "")

"""K06's gyro over frequency: gain and delay, and what the compensation gains (table 6.5)."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.gyro import main

if __name__ == "__main__":
    script(main, __doc__ or "")

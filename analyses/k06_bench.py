"""K06's rotating bench: the navigation's errors by square wave (table 6.6), by aid (6.7), and figure 6.20."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.bench import main

if __name__ == "__main__":
    script(main, __doc__ or "")

"""K06 figure 6.23: which missing effect leaves a steady error astern and none ahead; would a log tell."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.reverse_error import main

if __name__ == "__main__":
    script(main, __doc__ or "")

"""K06's trials in the real loop over many seeds: each figure asked for, and how often it is met."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.trial_bands import main

if __name__ == "__main__":
    script(main, __doc__ or "")

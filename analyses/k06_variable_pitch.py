"""K06 chapter 7: what a variable-pitch propeller would gain, trial by trial, over K06's reversing fan."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.variable_pitch import main

if __name__ == "__main__":
    script(main, __doc__ or "")

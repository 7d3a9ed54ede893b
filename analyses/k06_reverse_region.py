"""K06's reverse law (2.30): theorem, linearisation and simulations, with and without the link's delay."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.law_regions import main_reverse as main

if __name__ == "__main__":
    script(main, __doc__ or "")

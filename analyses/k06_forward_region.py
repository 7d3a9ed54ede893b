"""K06's forward law (2.24): theorem, linearisation and simulations, with and without the link's delay."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.law_regions import main_forward as main

if __name__ == "__main__":
    script(main, __doc__ or "")

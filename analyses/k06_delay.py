"""K06 (5.1): the law that knows the link's constant delay beside one that does not, on the craft ahead."""

from hovercontrol.control.analysis.output import script
from hovercontrol.documents.k06.delay import main

if __name__ == "__main__":
    script(main, __doc__ or "")

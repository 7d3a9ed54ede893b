"""What is rebuilt of K06; importing it collects the items of its topics."""

from hovercontrol.documents.k06 import bench, diagrams, hardware, trials
from hovercontrol.documents.printed import add

__all__ = ["bench", "diagrams", "hardware", "trials"]

for _item in (*hardware.ITEMS, *trials.ITEMS):
    add(_item)

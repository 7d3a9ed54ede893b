"""What is rebuilt of K06; importing it collects the items of its topics."""

from hovercontrol.documents.k06 import diagrams, gyro, hardware, trials
from hovercontrol.documents.k06.bench import aids, square_wave, units
from hovercontrol.documents.printed import add

__all__ = ["aids", "diagrams", "gyro", "hardware", "square_wave", "trials", "units"]

for _item in (*hardware.ITEMS, *trials.ITEMS):
    add(_item)

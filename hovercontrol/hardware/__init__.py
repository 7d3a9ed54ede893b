"""Hardware of a craft, its imperfections included, as Blocks: actuators, sensors, links, and calibration."""

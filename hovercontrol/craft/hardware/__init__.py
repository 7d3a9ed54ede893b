"""Hardware of a craft with its imperfections, as Blocks: actuators, sensors, links, and calibration."""

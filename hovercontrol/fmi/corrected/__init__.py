"""An FMU with Blocks around it as one FMU, without Python."""

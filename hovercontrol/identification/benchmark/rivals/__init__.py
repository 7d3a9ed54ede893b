"""Other tools, scored beside this package's: PySINDy on residuals, and a linear ARX model of residuals."""

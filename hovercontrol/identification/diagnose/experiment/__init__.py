"""The next experiment: commands that distinguish rivals, or reduce a large standard error."""

"""The next experiment: commands that set rivals apart, or tell more of a coefficient that is known badly."""

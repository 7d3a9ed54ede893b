"""Logs replayed through an FMU: parameters estimated, effects around it found."""

"""Logs: reading them, joining them, and velocities from tracked positions."""

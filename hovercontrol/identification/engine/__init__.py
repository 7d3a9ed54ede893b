"""Estimation of unknowns, states and noise from logs, used by identification and the search for effects."""

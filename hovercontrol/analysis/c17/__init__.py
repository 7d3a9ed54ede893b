"""Analyses of C17's tracking loop: its theorems, its gains, its Table II."""

"""Analyses of any Block or log: observability, excitation, margins, regions."""

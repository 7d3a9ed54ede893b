"""Figures, tables, results and analyses of K06, a file for each topic."""

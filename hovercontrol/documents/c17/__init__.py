"""Figures, tables, results and analyses of C17, a file for each topic."""

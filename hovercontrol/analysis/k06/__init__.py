"""Analyses of K06's laws, bench and real loop."""

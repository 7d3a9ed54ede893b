"""Logs of simulated craft whose coefficients are known, and what a fit is made of."""

from ..identify.conftest import cart, cart_log, rudder_log

__all__ = ["cart", "cart_log", "rudder_log"]

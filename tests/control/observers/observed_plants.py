"""Plants for tests of observers, noisy runs of a craft, and a textbook's extended Kalman filter."""

import numpy as np
from scipy.integrate import solve_ivp

import hovercontrol as hc

H = 0.05
NOISE = {"process_noise": {"v": 0.3}, "measurement_noise": {"x": 0.02}}
CRAFT_NOISE = {
    "process_noise": {"u": 0.1, "v": 0.1, "r": 0.2},
    "measurement_noise": {"x": 0.01, "y": 0.01, "psi": 0.02},
    "start_std": {"x": 0.02, "y": 0.02, "psi": 0.05, "u": 0.1, "v": 0.1, "r": 0.1},
}


def cart(drag=0.8):
    """A mass with drag, pushed: x' = v, v' = -drag v + push."""
    x, v, push = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("push", "m/s^2")
    k = hc.Signal("drag", "1/s", start=drag)
    rates = {"x": v.symbol, "v": push.symbol - k.symbol * v.symbol}
    return hc.Block("cart", [x, v], [push], [x, v], [k], rates)


def matrices(drag=0.8):
    return np.array([[0.0, 1.0], [0.0, -drag]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])


def covariance(block, state, n):
    """P of a filter's state, and its estimate."""
    values = dict(zip((s.name for s in block.states), state, strict=True))
    P = np.array([[values[f"P[{min(i, j)},{max(i, j)}]"] for j in range(n)] for i in range(n)])
    return np.array([values[f"xhat[{i}]"] for i in range(n)]), P


def by_hand(plant, x, P, Q, R, h, samples, commands, fresh):
    """An extended Kalman filter as a textbook has it: solve_ivp for x and P, all measurements at once."""
    f, C = plant.to_numpy(), np.eye(3, 6)

    def rates(_, z, u):
        F = f.jacobian(0.0, z[:6], u)
        P = z[6:].reshape(6, 6)
        return np.r_[f.derivatives(0.0, z[:6], u), (F @ P + P @ F.T + Q).ravel()]

    for y, u, new in zip(samples, commands, fresh, strict=True):
        if new:
            innovation = y - C @ x
            innovation[2] = np.angle(np.exp(1j * innovation[2]))
            K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
            x, P = x + K @ innovation, (np.eye(6) - K @ C) @ P
        yield x, P
        z = solve_ivp(rates, (0, h), np.r_[x, P.ravel()], args=(u,), rtol=1e-10, atol=1e-12).y[:, -1]
        x, P = z[:6], z[6:].reshape(6, 6)


def truth(plant, h, steps, seed, start):
    """A noisy run: motion, samples, commands."""
    rng = np.random.default_rng(seed)
    f, x = plant.to_numpy(), np.array(start)
    fine = 10
    Q = np.array([0, 0, 0, 0.1, 0.1, 0.2])
    rows = []
    for k in range(steps):
        u = np.array([2.0 + 0.5 * np.sin(0.4 * k * h), 0.3 * np.sin(0.7 * k * h)])
        rows.append((x.copy(), x[:3] + rng.normal(size=3) * [0.01, 0.01, 0.02], u))
        for _ in range(fine):  # Euler and Maruyama
            x = x + f.derivatives(0.0, x, u) * h / fine + Q * rng.normal(size=6) * (h / fine) ** 0.5
    return [np.array(c) for c in zip(*rows, strict=True)]


START = {"u": 1.2, "v": -0.2, "r": 0.4, "psi": 3.13}


def soft_craft():
    """A craft whose dry friction is smoothed over 5 cm/s: one Runge-Kutta step for each sample will do."""
    widths = {f"plant.{axis}_coulomb_width": 0.05 for axis in ("surge", "sway", "yaw")}
    return hc.vehicle("c17_simulation").plant().with_values(widths)

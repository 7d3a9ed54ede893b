"""C17's sampled estimator as textbooks write it, with C17 (13) written out: for other tests."""

import numpy as np


def sums(motion, command):
    """Return h and G of C17's craft: u', v', r' = h + G c, friction smoothed over 0.01 m/s and rad/s."""
    (u, v, r), (T, th) = motion, command
    su, sv, sr = np.tanh(np.array(motion) / 0.01)
    G = np.zeros((3, 8))
    G[0, :2], G[1, 2:4], G[2, 4:6] = (-su, -u), (-sv, -v), (-sr, -r)
    G[0, 6], G[1, 6], G[2, 7] = T * np.cos(th), T * np.sin(th), -T * np.sin(th)
    return np.array([v * r, -u * r, 0.0]), G


class Textbook:
    """The discrete Kalman filter of C17's eight coefficients; the first sample gives the states."""

    def __init__(self, coefficients, dt, R, Q, P0):
        self.c, self.dt, self.before = np.array(coefficients, dtype=float), dt, None
        self.R, self.Q = np.diag(np.broadcast_to(R, 3)) / dt, np.diag(np.broadcast_to(Q, 11)) * dt
        self.P = np.diag(np.broadcast_to(P0, 11))

    def step(self, y, held):
        """Take a sample; `held` acted since the sample before. Return the coefficients."""
        y = np.array(y, dtype=float)
        if self.before is None:
            self.xi = np.concatenate([y, self.c])
            self.P[:3] = self.P[:, :3] = 0.0
            self.P[:3, :3] = self.R
        else:
            (h0, G0), (h1, G1) = sums(self.before, held), sums(y, held)
            F, H = np.eye(11), np.eye(3, 11)
            F[:3, 3:] = self.dt * (G0 + G1) / 2
            self.xi = F @ self.xi + np.concatenate([self.dt * (h0 + h1) / 2, np.zeros(8)])
            self.P = F @ self.P @ F.T + self.Q
            K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + self.R)
            self.xi, self.P = self.xi + K @ (y - H @ self.xi), (np.eye(11) - K @ H) @ self.P
        self.before = y
        return self.xi[3:]

"""Titles of the analyses, as the gallery shows them."""

from __future__ import annotations

#: Title of each script in ``analyses/``.
TITLES = {
    "c17_beta_region": "Which Lyapunov weight guarantees the fastest decay",
    "c17_excitation": "Which path shows which coefficient",
    "c17_gain_region": "Where the gains keep the craft stable",
    "c17_interconnection": "From where craft, controller and estimator converge together",
    "c17_iss_gain": "What wrong coefficients cost in tracking error",
    "c17_table2": "How Table II depends on values that the paper does not print",
    "c17_zero_dynamics": "When the craft goes nose first, goes stern first or spins",
    "k06_bench": "Navigation errors on a rotating bench",
    "k06_budget": "What each imperfection of the real loop costs",
    "k06_consistency": "Are the navigation filters' errors as large as their covariances?",
    "k06_delay": "A control law that knows the link's delay, beside one that does not",
    "k06_forward_region": "Where the forward law converges",
    "k06_gyro": "Gain and delay of the gyro over frequency",
    "k06_margins": "How much delay, jitter and packet loss a loop tolerates",
    "k06_particles": "A particle filter beside the extended Kalman filter",
    "k06_reverse_error": "Why only reverse motion has a steady error",
    "k06_reverse_region": "Where the reverse law converges",
    "k06_steering": "How closely the craft follows the stick",
    "k06_trials": "Every trial over many random seeds",
    "k06_turn_basins": "From which velocities the craft reaches its turn",
    "k06_variable_pitch": "What a variable-pitch propeller gains",
}

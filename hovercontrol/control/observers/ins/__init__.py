"""Aided inertial navigation: K06's filters (chapter 3, section 5.4.5) and the extensions that K06 proposes.

:func:`ins_mechanisation` integrates the IMU. :func:`heading_filter` and :func:`velocity_position_filter`
estimate the errors of that integration; :func:`aided_ins` connects the three. :func:`coupled_filter` needs no
heading aid, and :func:`range_filter` uses raw ranges. All of these are sampled Blocks.
:func:`range_particles`, the particle filter on raw ranges, has the same inputs and outputs.
:func:`run_ins` runs one filter over a log, :func:`simulate_runs` runs many simulations at once, and
:func:`consistency` checks whether a filter's errors agree with its covariance.
"""

from hovercontrol.blocks.simulation.sampled import simulate_runs
from hovercontrol.control.observers.ins.aided import aided_ins
from hovercontrol.control.observers.ins.consistency import Consistency, consistency
from hovercontrol.control.observers.ins.coupled import coupled_filter
from hovercontrol.control.observers.ins.heading import heading_filter
from hovercontrol.control.observers.ins.imu import IMU_PERIOD
from hovercontrol.control.observers.ins.mechanisation import ins_mechanisation
from hovercontrol.control.observers.ins.noise import K06_NOISE, InsNoise, SensorErrors, noise_from_sensors
from hovercontrol.control.observers.ins.particles import ParticleFilter, range_particles
from hovercontrol.control.observers.ins.ranges import range_arrivals, range_filter
from hovercontrol.control.observers.ins.run import run_ins
from hovercontrol.control.observers.ins.velocity_position import velocity_position_filter

__all__ = [
    "ins_mechanisation", "heading_filter", "velocity_position_filter", "aided_ins",
    "coupled_filter", "range_filter", "range_arrivals", "range_particles", "ParticleFilter",
    "InsNoise", "K06_NOISE", "SensorErrors", "noise_from_sensors", "IMU_PERIOD",
    "run_ins", "simulate_runs", "Consistency", "consistency",
]  # fmt: skip

"""Experiments in closed loop: accuracy, horizon, deadlocks, observers, the two-level drive."""

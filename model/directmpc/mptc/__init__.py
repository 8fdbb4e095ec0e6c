"""Two-level induction drive: predictive torque and flux control (Paper B): models."""

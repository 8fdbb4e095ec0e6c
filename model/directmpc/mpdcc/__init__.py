"""Multilevel drive: model predictive direct current control (Paper A), models and plant."""

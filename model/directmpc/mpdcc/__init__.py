"""Five-level ANPC drive: model predictive direct current control (Paper A), models and plant."""

"""Resources, clock frequency, budgets, the trade-off between them, bitstreams, style."""

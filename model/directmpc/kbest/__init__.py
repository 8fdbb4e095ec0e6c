"""K-best direct MPC: turn-ons and mean square current error over a fixed horizon."""

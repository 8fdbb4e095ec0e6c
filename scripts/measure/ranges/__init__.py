"""Ranges of sums, shown by arithmetic on intervals; ``table`` lists them."""

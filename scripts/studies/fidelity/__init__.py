"""How close the bit-true controllers come to the ideal one, and what keeps them from it."""

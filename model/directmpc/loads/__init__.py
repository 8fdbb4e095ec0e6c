"""The loads that an inverter can feed, one file each."""

"""Build, measurement and release tools of the project; run them through the Makefile."""

"""What is published: every number, table and picture of reports/, README and docs/."""

"""The host's side of the links: frame protocol, client, and the commands built on them."""

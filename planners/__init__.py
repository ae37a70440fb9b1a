"""Where to touch next: exploratory procedures as generators of moves."""

"""Many jobs of one kind: a plan (TOML), its tasks, where they run, and the results as they come."""

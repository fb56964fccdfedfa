"""The search: cost and its Gram sums, descents side by side, variable projection and population searches."""

"""Parameter search: cost, Gram matrices, parallel descents, variable projection, genetic algorithm."""

"""Search for parameters: cost, Gram matrices, parallel descents, variable projection, genetic algorithm."""

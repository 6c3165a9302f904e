"""What a system consists of: unknowns, equations in batches, priors, losses and weights."""

"""How a solution is reached: strategies, steps, constraints and datum."""

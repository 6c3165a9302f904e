"""Commands on survey networks: their adjustment, plan and comparison."""

"""Field books of Leica: GSI-8 and GSI-16."""

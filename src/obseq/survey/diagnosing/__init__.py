"""The diagnosis of a survey network: the model that the engine works on, and what it says."""

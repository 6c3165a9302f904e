"""Field books of total stations: each reader fills a `Book`, which makes observations of it."""

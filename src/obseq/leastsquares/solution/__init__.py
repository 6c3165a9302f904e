"""What an adjustment found: the record, covariances, and its forms for people and programs."""

"""Sights between the points of a field book: who sees whom, and what leads from station to station."""

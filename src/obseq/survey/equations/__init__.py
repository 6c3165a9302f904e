"""The equations of a survey network: its unknowns, plumb lines, known coordinates, and what is loose."""

"""Networks of SNAP, the program of Land Information New Zealand: commands, stations and observations."""

"""Tables of results: each declared once, of what records hold, with the units that they are told in."""

"""Solutions of GNSS networks as SINEX."""

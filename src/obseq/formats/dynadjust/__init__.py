"""Networks of DynAdjust: DNA and DynaML files, and geoid files."""

"""What results are made of: typed records that adjustments fill and reports print."""

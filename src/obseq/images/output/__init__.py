"""Results of a bundle adjustment: the record, the text that is printed, clouds and tables."""

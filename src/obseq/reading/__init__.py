"""Reading text, tables and XML: one place, where every error names its file and line."""

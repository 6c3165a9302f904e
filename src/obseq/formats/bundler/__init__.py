"""Results of Bundler."""

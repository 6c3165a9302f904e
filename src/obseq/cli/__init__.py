"""The `obseq` command: one module per subcommand, each light to import; the work is loaded when it starts."""

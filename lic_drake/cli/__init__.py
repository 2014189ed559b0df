"""The `lic` command: one module per subcommand, light to import."""

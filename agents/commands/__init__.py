"""The words of the command line, a module each: `configure(parser)` and `run(arguments) -> exit code`."""

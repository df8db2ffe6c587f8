"""Command-line tools: thin, arguments in and tables or figures out."""

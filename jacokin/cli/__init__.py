"""The command line: it parses and prints, and leaves every computation to the packages below it."""

"""One module a family of tasks. Read `reach` first."""
